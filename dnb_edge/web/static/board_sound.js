// Beeps and spoken laps, both off until somebody switches them on. Knows the browser's audio and speech; knows no page.

const KEYS = { beeps: "dnb-edge.beeps", speech: "dnb-edge.speech" };
/** [hertz, from second, to second] of each sound. */
const SOUNDS = {
  crossing: [[880, 0, 0.09]],
  best: [[784, 0, 0.09], [988, 0.1, 0.19], [1319, 0.2, 0.38]],
  penalty: [[220, 0, 0.16], [196, 0.18, 0.4]],
  count: [[523, 0, 0.12]],
  go: [[1047, 0, 0.5]],
};

export class Sounds {
  #audio = null;
  on = { beeps: kept(KEYS.beeps), speech: kept(KEYS.speech) };

  constructor() {
    // A browser lets a page sound only once somebody has touched it; what was switched on another day goes on with that.
    for (const touch of ["pointerdown", "keydown"]) addEventListener(touch, () => this.#unlock(), { passive: true });
  }

  /** Whether this browser can: {beeps, speech}. */
  static get there() {
    return { beeps: "AudioContext" in globalThis, speech: "speechSynthesis" in globalThis };
  }

  switch(name, on) {
    this.on[name] = on;
    keep(KEYS[name], on);
    this.#unlock();
    if (on && name === "beeps") this.beep("crossing");
    if (on && name === "speech") this.say("laps are spoken");
    if (!on && name === "speech") globalThis.speechSynthesis?.cancel();
  }

  beep(name) {
    if (!this.on.beeps || this.#audio === null || this.#audio.state !== "running") return;
    const begin = this.#audio.currentTime + 0.01;
    for (const [hertz, from, to] of SOUNDS[name]) {
      const tone = this.#audio.createOscillator();
      const loudness = this.#audio.createGain();
      tone.frequency.value = hertz;
      tone.type = name === "penalty" ? "square" : "sine";
      // Ramps, since a tone that is cut clicks.
      loudness.gain.setValueAtTime(0, begin + from);
      loudness.gain.linearRampToValueAtTime(0.25, begin + from + 0.01);
      loudness.gain.setValueAtTime(0.25, begin + to - 0.02);
      loudness.gain.linearRampToValueAtTime(0, begin + to);
      tone.connect(loudness).connect(this.#audio.destination);
      tone.start(begin + from);
      tone.stop(begin + to);
    }
  }

  say(text) {
    if (!this.on.speech || !Sounds.there.speech) return;
    const words = new SpeechSynthesisUtterance(text);
    words.lang = "en-GB";
    // What is spoken late is of no use: the newest only.
    if (speechSynthesis.pending) speechSynthesis.cancel();
    speechSynthesis.speak(words);
  }

  #unlock() {
    if (!this.on.beeps || !Sounds.there.beeps) return;
    this.#audio ??= new AudioContext();
    if (this.#audio.state === "suspended") this.#audio.resume();
  }
}

function kept(key) {
  try {
    return localStorage.getItem(key) === "on";
  } catch {
    return false;
  }
}

function keep(key, on) {
  try {
    localStorage.setItem(key, on ? "on" : "off");
  } catch {
    return; // it holds as long as the page then
  }
}
