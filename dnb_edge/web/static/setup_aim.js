// Aiming: the live picture, how sharp each part of it is and how well exposed, taking it, the camera's settings.

import { ask, send } from "./setup_api.js";

const byId = (id) => document.getElementById(id);
const AGAIN_MS = 1500;
const OTHER = { exposure_us: true, white_balance_k: true, focus: true };

export function aimStep(setup) {
  let going = 0;
  let best = {};

  async function watch(turn) {
    let after = null;
    while (going === turn) {
      try {
        const query = after === null ? "" : `?after=${after}`;
        const [said, picture] = await Promise.all([ask("GET", `look${query}`), blob(`/api/v1/picture.jpg${query}`)]);
        after = said.t_ns;
        if (going !== turn) return;
        await shown(picture);
        told(said);
        byId("no-picture").hidden = true;
      } catch (error) {
        if (going !== turn) return;
        byId("no-picture").textContent = error.message;
        byId("no-picture").hidden = false;
        await new Promise((resolve) => { setTimeout(resolve, AGAIN_MS); });
      }
    }
  }

  function told(said) {
    const rows = Object.entries(said.sharpness).map(([name, sharp]) => {
      best[name] = Math.max(best[name] ?? 0, sharp);
      return bar(name, sharp, best[name]);
    });
    byId("focus").replaceChildren(...rows);
    const percent = (share) => `${(100 * share).toFixed(1)} %`;
    byId("light").textContent = said.fault === null
      ? `Good: ${percent(said.dark_share)} black, ${percent(said.bright_share)} without shade.`
      : said.fault[0].toUpperCase() + said.fault.slice(1);
    byId("flicker").textContent = said.flicker ?? "";
    byId("flicker").hidden = said.flicker === null;
  }

  byId("focus-anew").addEventListener("click", () => { best = {}; });
  byId("take").addEventListener("click", () => setup.change(() => ask("POST", "photo")));
  byId("photo-file").addEventListener("change", async (event) => {
    const [file] = event.target.files;
    if (file) await setup.change(() => send("photo", file));
    event.target.value = "";
  });
  byId("camera-form").addEventListener("submit", (event) => {
    event.preventDefault();
    const camera = settings(event.target);
    setup.change(async () => {
      const kept = await ask("PUT", "camera", camera);
      if (byId("race-or-aim").dataset.aim === "no") await ask("POST", "/api/v1/race/aim", { aim: true, camera });
      return kept;
    });
  });
  byId("race-or-aim").addEventListener("click", async () => {
    const aim = byId("race-or-aim").dataset.aim === "yes";
    try {
      await ask("POST", "/api/v1/race/aim", { aim });
      await raceState();
    } catch (error) {
      setup.trouble(error.message);
    }
  });

  async function raceState() {
    const button = byId("race-or-aim");
    try {
      const said = await ask("GET", "/api/v1/state");
      const phase = (said.state ?? said)?.phase ?? null;
      button.hidden = phase !== "racing" && phase !== "setup";
      button.dataset.aim = phase === "racing" ? "yes" : "no";
      button.textContent = phase === "racing" ? "End the race, show the camera only" : "Race again";
      if (phase === "setup" && !setup.answer?.configured) button.hidden = true;
    } catch {
      button.hidden = true; // the live picture says what is wrong
    }
  }

  return {
    enter() { going += 1; watch(going); raceState(); },
    leave() { going += 1; },
    render(answer) {
      const form = byId("camera-form");
      if (form.contains(document.activeElement)) return;
      for (const [name, value] of Object.entries(answer.draft.camera)) form.elements[name].value = value ?? "";
    },
  };
}

function settings(form) {
  const body = {};
  for (const { name, value } of form.elements) {
    const text = value.trim();
    if (name === "" || text === "") continue;
    const number = Number(text.replace(",", "."));
    if (name === "source") body[name] = text;
    else if (Number.isFinite(number)) body[name] = number;
    else body[name] = OTHER[name] ? text.toLowerCase() : text;
  }
  return body;
}

function bar(name, sharp, best) {
  const row = document.createElement("div");
  row.className = "setup-bar";
  const way = document.createElement("span");
  way.className = "setup-bar__way";
  const most = Math.max(best * 1.1, 1e-9);
  const now = document.createElement("span");
  now.style.width = `${(100 * sharp) / most}%`;
  const mark = document.createElement("span");
  mark.style.left = `calc(${(100 * best) / most}% - 3px)`;
  way.append(now, mark);
  const title = document.createElement("span");
  title.textContent = name;
  const number = document.createElement("span");
  number.className = "setup-bar__number";
  number.textContent = `${best > 0 ? Math.round((100 * sharp) / best) : 0} %`;
  row.append(title, way, number);
  return row;
}

export async function blob(address) {
  const answer = await fetch(address);
  if (answer.ok) return answer.blob();
  const body = await answer.json().catch(() => null);
  throw new Error(body?.error?.text ?? `The box answers ${answer.status}.`);
}

async function shown(picture) {
  const image = await createImageBitmap(picture);
  const canvas = byId("live");
  if (canvas.width !== image.width || canvas.height !== image.height) { canvas.width = image.width; canvas.height = image.height; }
  canvas.getContext("2d").drawImage(image, 0, 0);
  image.close();
}
