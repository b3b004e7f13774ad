// For who may change something: another run, with a name for whoever drives.

import { toast } from "./ui.js";

const dialog = document.getElementById("new-run");
const form = dialog.querySelector("form");

document.getElementById("new-run-open").addEventListener("click", () => dialog.showModal());
document.getElementById("new-run-cancel").addEventListener("click", () => dialog.close());
form.addEventListener("submit", async (event) => {
  event.preventDefault();
  const entry = form.elements.entry.value.trim();
  const refused = await begin(entry === "" ? null : entry);
  dialog.close();
  toast(refused ?? "Another run begins.", { bad: refused !== null });
});

/** Null where it is done, else why not. */
async function begin(entry) {
  try {
    const answer = await fetch("/api/v1/race/new", {
      method: "POST",
      headers: { "Content-Type": "application/json", "X-CSRF-Token": document.querySelector("meta[name=csrf]").content },
      body: JSON.stringify({ entry }),
    });
    return answer.ok ? null : ((await answer.json()).error?.text ?? `refused (${answer.status})`);
  } catch {
    return "The box does not answer: try again when the board says live.";
  }
}
