// The set-up's page: its steps, what the box answered last, and what belongs to several steps. Each step has its own module.

import { ask, sendBytes } from "./setup_api.js";
import { aimStep } from "./setup_aim.js";
import { driveStep } from "./setup_drive.js";
import { keypointsStep } from "./setup_keypoints.js";
import { linesStep } from "./setup_lines.js";
import { routeStep } from "./setup_route.js";
import { twinStep } from "./setup_twin.js";
import { confirmed } from "./ui.js";

const byId = (id) => document.getElementById(id);
const root = byId("setup");
const keys = [...document.querySelectorAll(".steps li")].map((item) => item.dataset.step);

/** What all steps share. `answer`: the box's last word on the draft. */
const setup = {
  answer: null,
  shown: null,
  /** Asks the box for something whose answer is the whole draft, and shows it; true where that went well. */
  async change(work) {
    busy(1);
    try {
      take(await work());
      trouble(null);
      return true;
    } catch (error) {
      trouble(error.message);
      return false;
    } finally {
      busy(-1);
    }
  },
  trouble,
  busy,
  twinAddress() { return picture("twin.png", this.answer?.draft.twin); },
  photoAddress() { return picture("picture.jpg", this.answer?.draft.photo); },
};

let waiting = 0;

function busy(more) {
  waiting += more;
  byId("busy").textContent = waiting > 0 ? "The box is working …" : "";
  root.dataset.ready = waiting > 0 || setup.answer === null ? "no" : "yes";
}

function picture(name, stored) {
  return stored ? { address: `/api/v1/setup/${name}?v=${stored.sha256.slice(0, 16)}`, size: [stored.width_px, stored.height_px] } : { address: null, size: null };
}

function trouble(text) {
  const place = byId("trouble");
  place.hidden = text === null;
  place.textContent = text ?? "";
  if (text !== null) place.scrollIntoView({ block: "nearest" });
}

function take(answer) {
  setup.answer = answer;
  for (const step of answer.steps) {
    const item = document.querySelector(`.steps li[data-step="${step.key}"]`);
    item.classList.toggle("is-done", step.state === "done");
    item.classList.toggle("is-bad", step.state === "wrong");
    const said = byId(step.key).querySelector(".state");
    said.replaceChildren(step.text, ...step.needs.map((need) => wayTo(answer, need)));
    byId(step.key).classList.toggle("is-blocked", step.needs.length > 0);
    said.className = `state notice${{ done: " notice--good", wrong: " notice--bad", open: "" }[step.state]}`;
  }
  byId("hint").hidden = answer.steps.some((step) => step.state === "done" && step.key !== "sectors");
  for (const step of Object.values(steps)) step.render?.(answer);
}

/** A link to a step that comes first. */
function wayTo(answer, key) {
  const link = document.createElement("a");
  link.className = "button button--small";
  link.href = `#${key}`;
  link.textContent = `Go to ${keys.indexOf(key) + 1} ${answer.steps.find((step) => step.key === key).title}`;
  return link;
}

function go() {
  const key = keys.includes(location.hash.slice(1)) ? location.hash.slice(1) : firstOpen();
  const at = keys.indexOf(key);
  if (setup.shown !== null && setup.shown !== key) steps[setup.shown]?.leave?.();
  for (const one of keys) byId(one).hidden = one !== key;
  for (const item of document.querySelectorAll(".steps li")) {
    if (item.dataset.step === key) {
      item.setAttribute("aria-current", "step");
      const strip = item.parentElement;
      strip.scrollLeft = item.offsetLeft - strip.offsetLeft - (strip.clientWidth - item.offsetWidth) / 2;
    } else item.removeAttribute("aria-current");
  }
  byId("back").hidden = at === 0;
  byId("next").hidden = at === keys.length - 1;
  byId("back").href = `#${keys[Math.max(0, at - 1)]}`;
  byId("next").href = `#${keys[Math.min(keys.length - 1, at + 1)]}`;
  const came = setup.shown !== key;
  setup.shown = key;
  trouble(null);
  if (came) steps[key]?.enter?.();
  if (setup.answer !== null) steps[key]?.render?.(setup.answer);
  if (came) scrollTo({ top: 0 });
}

function firstOpen() { return setup.answer?.steps.find((step) => step.state !== "done")?.key ?? keys[0]; }

function saveStep() {
  byId("save-now").addEventListener("click", () => setup.change(async () => {
    const saved = await ask("POST", "save");
    byId("saved").textContent = saved.text;
    return ask("GET", "");
  }));
  return {
    render(answer) {
      const ready = answer.steps.findIndex((step) => step.key === "save");
      byId("checks").replaceChildren(...answer.steps.slice(0, ready).map((step) => {
        const item = document.createElement("li");
        const pill = document.createElement("span");
        pill.className = `pill${{ done: " pill--good", wrong: " pill--bad", open: "" }[step.state]}`;
        pill.textContent = { done: "done", wrong: "wrong", open: "open" }[step.state];
        const link = document.createElement("a");
        link.href = `#${step.key}`;
        link.textContent = step.title;
        const text = document.createElement("span");
        text.textContent = step.text;
        item.append(pill, link, text);
        return item;
      }));
    },
  };
}

function teachStep() {
  byId("model-files").addEventListener("change", async (event) => {
    const files = [...event.target.files];
    const card = files.find((file) => file.name.endsWith(".json")), model = files.find((file) => file.name.endsWith(".onnx"));
    if (model === undefined) setup.trouble("Choose the model, a file that ends in .onnx, and its card, the .json beside it.");
    else {
      await setup.change(async () => {
        if (card !== undefined) await sendBytes("model/card", card);
        return sendBytes("model", model);
      });
    }
    event.target.value = "";
  });
  byId("model-forget").addEventListener("click", () => setup.change(() => ask("DELETE", "model")));
  return {
    render(answer) { byId("model-forget").hidden = answer.draft.model === null; },
    async enter() {
      try {
        const told = await ask("GET", "teach");
        byId("teach-said").textContent = told.text;
        byId("teach-commands").replaceChildren(...told.commands.map((command) => {
          const line = document.createElement("pre");
          line.tabIndex = 0;
          line.textContent = command;
          return line;
        }));
      } catch (error) {
        byId("teach-said").textContent = error.message;
      }
    },
  };
}

const lines = linesStep(setup);
const steps = {
  aim: aimStep(setup), twin: twinStep(setup), route: routeStep(setup), keypoints: keypointsStep(setup),
  start: lines.start, sectors: lines.sectors, save: saveStep(), drive: driveStep(setup), teach: teachStep(),
};

byId("begin-anew").addEventListener("click", async () => {
  const sure = await confirmed("Begin anew?", {
    text: "The draft with its pictures and clicks is forgotten. What was saved stays in place.", yes: "Begin anew", danger: true,
  });
  if (sure) setup.change(() => ask("DELETE", ""));
});

addEventListener("hashchange", go);
// A phone that comes back, or another one that has changed something meanwhile.
document.addEventListener("visibilitychange", () => {
  if (document.visibilityState === "visible" && setup.answer !== null) setup.change(() => ask("GET", ""));
});
await setup.change(() => ask("GET", ""));
go();
