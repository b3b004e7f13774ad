// The set-up's part of the API: asks, and throws `Refused` with words for people where something is refused. Knows no page.

const BASE = "/api/v1/setup";

export class Refused extends Error {
  constructor(text, status) {
    super(text);
    this.status = status;
  }
}

/** GET or DELETE without a body, or a JSON body. */
export async function ask(method, path, body = undefined) {
  const headers = body === undefined ? {} : { "Content-Type": "application/json" };
  return answered(path, { method, headers, body: body === undefined ? undefined : JSON.stringify(body) });
}

/** A picture file as it is. */
export async function send(path, file) {
  return answered(path, { method: "PUT", headers: { "Content-Type": kindOf(file) }, body: file });
}

/** Any other file as it is. */
export async function sendBytes(path, file) {
  return answered(path, { method: "PUT", headers: { "Content-Type": "application/octet-stream" }, body: file });
}

async function answered(path, wanted) {
  const token = document.querySelector('meta[name="csrf"]')?.content ?? "";
  let answer;
  try {
    answer = await fetch(path.startsWith("/") ? path : `${BASE}${path === "" ? "" : `/${path}`}`, {
      ...wanted, headers: { ...wanted.headers, "X-CSRF-Token": token },
    });
  } catch {
    throw new Refused("The box does not answer: is this device still on its network? What you have done so far is kept.", 0);
  }
  const body = await answer.json().catch(() => null);
  if (answer.status === 401) location.assign(`/login?next=${encodeURIComponent(location.pathname)}`);
  if (!answer.ok) throw new Refused(body?.error?.text ?? `The box answers ${answer.status}.`, answer.status);
  return body;
}

// Whether it really is one is found out by the box, which looks into it.
function kindOf(file) { return file.type === "image/jpeg" ? "image/jpeg" : "image/png"; }
