// The one client of the live stream: events in their order, none twice, and none lost of those that last (laps, crossings,
// scores ...), whatever happens to the line. Where the cars were while it was broken nobody keeps.
// Knows sockets and sequence numbers; knows no page and nothing of a race.

/** How the line stands, for `onLine`. */
export const Line = Object.freeze({
  CONNECTING: "connecting",
  CONNECTED: "connected",
  DAEMON_DOWN: "daemon-down",
  RECONNECTING: "reconnecting",
});

const FIRST_WAIT_MS = 250;
const MOST_WAIT_MS = 8000;
/** After so long without a word the line may be dead without anybody having said so (a phone that slept): open another. */
const SILENT_MS = 20000;

/**
 * Follow the race.
 *
 * @param {object} told
 * @param {(hello: {epoch: string, next: number, resumed: boolean}) => void} [told.onHello] where `resumed` is false: forget all,
 *   everything that is kept follows
 * @param {(state: object|null) => void} [told.onState] what the daemon says of itself; null while it is down
 * @param {(event: object, about: {sequence: number, past: boolean}) => void} [told.onEvent] `past`: it had happened before this
 *   line was opened (no sounds for these)
 * @param {(line: string, about: {retryAt: number|null}) => void} [told.onLine] one of `Line`, whenever that changes;
 *   `retryAt`: when it is tried again, on `Date.now()`'s clock
 * @param {object} [world] for tests: `open(url)`, `now()`, `after(ms, run)`, `stop(timer)`, `chance()`
 * @returns {{close: () => void}}
 */
export function follow(told, world = {}) {
  const line = new LiveLine(told, { ...BROWSER, ...world });
  line.open();
  return { close: () => line.close() };
}

const BROWSER = {
  open: (url) => new WebSocket(url),
  now: () => Date.now(),
  after: (ms, run) => setTimeout(run, ms),
  stop: (timer) => clearTimeout(timer),
  chance: () => Math.random(),
};

/** Where the stream is, from number `since` of epoch `epoch` on. */
export function address(epoch, since) {
  const url = new URL("/api/v1/live", globalThis.location?.href ?? "http://localhost/");
  url.protocol = url.protocol === "https:" ? "wss:" : "ws:";
  if (epoch !== null && since !== null) {
    url.searchParams.set("epoch", epoch);
    url.searchParams.set("since", String(since));
  }
  return url.href;
}

class LiveLine {
  #told;
  #world;
  #socket = null;
  #epoch = null;
  /** Number after that of the last event; null where all is to come anew. Numbers are left out where nobody kept an event. */
  #next = null;
  #pastBefore = 0;
  #failures = 0;
  #shown = null;
  #retry = null;
  #watch = null;
  #closed = false;
  #wake = () => this.#woken();

  constructor(told, world) {
    this.#told = told;
    this.#world = world;
    globalThis.addEventListener?.("online", this.#wake);
    globalThis.document?.addEventListener?.("visibilitychange", this.#wake);
  }

  open() {
    this.#retry = null;
    if (this.#shown === null) this.#show(Line.CONNECTING);
    const socket = this.#world.open(address(this.#epoch, this.#next));
    this.#socket = socket;
    socket.onmessage = (message) => this.#heard(socket, message.data);
    socket.onclose = () => this.#lost(socket);
    socket.onerror = () => {}; // `onclose` follows
    this.#watchSilence(socket);
  }

  close() {
    this.#closed = true;
    globalThis.removeEventListener?.("online", this.#wake);
    globalThis.document?.removeEventListener?.("visibilitychange", this.#wake);
    this.#world.stop(this.#retry);
    this.#world.stop(this.#watch);
    this.#leave();
  }

  #heard(socket, text) {
    if (socket !== this.#socket) return;
    this.#watchSilence(socket);
    const message = read(text);
    switch (message?.kind) {
      case "hello":
        this.#hello(message);
        break;
      case "state":
        this.#show(message.state === null ? Line.DAEMON_DOWN : Line.CONNECTED);
        this.#told.onState?.(message.state);
        break;
      case "event":
        this.#event(message);
        break;
    }
  }

  #hello(hello) {
    this.#failures = 0;
    if (!hello.resumed) this.#next = null;
    this.#epoch = hello.epoch;
    this.#pastBefore = hello.next;
    if (hello.epoch !== null && this.#shown !== Line.DAEMON_DOWN) this.#show(Line.CONNECTED);
    this.#told.onHello?.(hello);
  }

  #event({ sequence, event }) {
    if (this.#next !== null && sequence < this.#next) return;
    this.#next = sequence + 1;
    this.#told.onEvent?.(event, { sequence, past: sequence < this.#pastBefore });
  }

  /** The line broke: again after a pause that grows, by chance a little shorter or longer, so that fifty pages do not knock at once. */
  #lost(socket) {
    if (socket !== this.#socket || this.#closed) return;
    this.#socket = null;
    this.#world.stop(this.#watch);
    const wait = Math.min(MOST_WAIT_MS, FIRST_WAIT_MS * 2 ** this.#failures) * (0.75 + 0.5 * this.#world.chance());
    this.#failures += 1;
    this.#show(Line.RECONNECTING, this.#world.now() + wait);
    this.#retry = this.#world.after(wait, () => this.open());
  }

  /** Somebody looks at the page, or the network is back: try at once. */
  #woken() {
    if (this.#retry === null || this.#closed || globalThis.document?.visibilityState === "hidden") return;
    this.#world.stop(this.#retry);
    this.#failures = 0;
    this.open();
  }

  #watchSilence(socket) {
    this.#world.stop(this.#watch);
    this.#watch = this.#world.after(SILENT_MS, () => {
      if (socket !== this.#socket) return;
      this.#leave();
      this.open();
    });
  }

  /** Away from this socket, whatever it may still say. */
  #leave() {
    const socket = this.#socket;
    this.#socket = null;
    socket?.close();
  }

  #show(line, retryAt = null) {
    if (line === this.#shown && retryAt === null) return;
    this.#shown = line;
    this.#told.onLine?.(line, { retryAt });
  }
}

function read(text) {
  try {
    return JSON.parse(text);
  } catch {
    return null; // not from our server
  }
}
