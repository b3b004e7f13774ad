// What the judge's page asks of the API. Knows addresses; knows no page.

const run = document.getElementById("judge").dataset.run;
const base = `/api/v1/runs/${encodeURIComponent(run)}`;

/** An answer that is no success: `code` for programs, `message` for people. */
export class Refusal extends Error {
  constructor(status, code, text) {
    super(text);
    this.status = status;
    this.code = code;
  }
}

export function look() {
  return ask("/edits");
}

export function passes() {
  return ask("/passes");
}

/** Makes the decision `wish`, or says what it would do where it has `dry_run`. */
export function decide(wish) {
  return ask("/edits", {
    method: "POST",
    headers: { "Content-Type": "application/json", "X-CSRF-Token": document.querySelector('meta[name="csrf"]')?.content ?? "" },
    body: JSON.stringify(wish),
  });
}

async function ask(path, options = {}) {
  let answer;
  try {
    answer = await fetch(base + path, options);
  } catch {
    throw new Refusal(0, "away", "The box does not answer: is it on, and are you in its network?");
  }
  const body = await answer.json().catch(() => null);
  if (answer.ok && body !== null) return body;
  const error = body?.error ?? { code: "unknown", text: `The box answered ${answer.status}.` };
  throw new Refusal(answer.status, error.code, error.text);
}
