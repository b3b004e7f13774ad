// The source's clock between its events, and a running lap that is painted from it. Knows numbers only: every method is told
// what the page's own clock says, in milliseconds.

const WINDOW_MS = 2000;
/** After so long without an event the clock stands: nobody knows whether the race goes on. */
const HELD_MS = 2500;
/** Steps back of up to so much are waited out; greater ones are true (a refused lap, another run). */
const WAITED_OUT_S = 0.5;

/** What time it is at the source. Of the events of the last two seconds the one that was least late sets it. */
export class SourceClock {
  #samples = [];

  /** An event of source time `t_s` is heard at `now_ms`. */
  heard(t_s, now_ms) {
    const ahead_s = t_s - now_ms / 1000;
    // Samples that are later and no less late make earlier ones superfluous: the first is always the greatest.
    while (this.#samples.length > 0 && this.#samples.at(-1).ahead_s <= ahead_s) this.#samples.pop();
    this.#samples.push({ ahead_s, now_ms });
    this.#forget(now_ms);
    this.last_ms = now_ms;
  }

  /** Source time at `now_ms`, seconds; null before the first event. Stands still once nothing has been heard for a while. */
  at(now_ms) {
    if (this.#samples.length === 0) return null;
    const until_ms = Math.min(now_ms, this.last_ms + HELD_MS);
    return this.#samples[0].ahead_s + until_ms / 1000;
  }

  /** True where the clock stands because nothing has been heard. */
  held(now_ms) {
    return this.#samples.length > 0 && now_ms > this.last_ms + HELD_MS;
  }

  reset() {
    this.#samples = [];
  }

  #forget(now_ms) {
    while (this.#samples.length > 1 && this.#samples[0].now_ms < now_ms - WINDOW_MS) this.#samples.shift();
  }
}

/** A figure that runs forward: small steps back are waited out, so that the eye sees none. */
export class Forward {
  #key = null;
  #shown = 0;

  /** What to show of `value`, the running time of lap `key`. */
  of(key, value) {
    const behind = this.#shown - value;
    if (key !== this.#key || behind <= 0 || behind > WAITED_OUT_S) {
      this.#key = key;
      this.#shown = value;
    }
    return this.#shown;
  }
}
