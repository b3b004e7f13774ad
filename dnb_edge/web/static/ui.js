// Small things that several pages need above themselves: a toast, a question. Knows no page.

const TOAST_MS = 6000;

/** Say `text` for a moment; `bad` ones stay until they are closed. A button does `action.run` where there is one. */
export function toast(text, { bad = false, action = null } = {}) {
  const box = toasts();
  const line = document.createElement("div");
  line.className = bad ? "toast toast--bad" : "toast";
  const words = document.createElement("span");
  words.textContent = text;
  line.append(words);
  if (action !== null) line.append(button(action.text, () => { line.remove(); action.run(); }));
  if (bad) line.append(button("Close", () => line.remove()));
  else setTimeout(() => line.remove(), TOAST_MS);
  box.append(line);
}

/** Ask; true where the answer is yes. `danger` for what cannot be undone. */
export function confirmed(question, { text = "", yes = "Yes", no = "Cancel", danger = false } = {}) {
  const dialog = document.createElement("dialog");
  dialog.className = "dialog";
  const heading = document.createElement("h2");
  heading.id = `question-${Date.now()}`;
  heading.textContent = question;
  dialog.setAttribute("aria-labelledby", heading.id);
  const words = document.createElement("p");
  words.textContent = text;
  const actions = document.createElement("div");
  actions.className = "dialog__actions";
  const answer = button(yes, () => dialog.close("yes"));
  answer.className = danger ? "button button--danger" : "button button--primary";
  const cancel = button(no, () => dialog.close("no"));
  cancel.className = "button";
  actions.append(cancel, answer);
  dialog.append(heading, ...(text === "" ? [] : [words]), actions);
  document.body.append(dialog);
  return new Promise((resolve) => {
    dialog.addEventListener("close", () => {
      dialog.remove();
      resolve(dialog.returnValue === "yes");
    });
    dialog.showModal();
    (danger ? cancel : answer).focus();
  });
}

function toasts() {
  const found = document.querySelector(".toasts");
  if (found !== null) return found;
  const made = document.createElement("div");
  made.className = "toasts";
  made.setAttribute("role", "status");
  document.body.append(made);
  return made;
}

function button(text, run) {
  const made = document.createElement("button");
  made.type = "button";
  made.textContent = text;
  made.addEventListener("click", run);
  return made;
}
