// Only what a projector needs besides the board: F or a double click fills the screen, and the screen stays awake.

addEventListener("keydown", (event) => {
  if (event.key === "f" || event.key === "F") fill();
});
addEventListener("dblclick", fill);
addEventListener("visibilitychange", stayAwake);
stayAwake();

function fill() {
  if (document.fullscreenElement !== null) document.exitFullscreen();
  else document.documentElement.requestFullscreen?.().catch(() => {}); // a browser that will not is full already, or forbids it
}

/** Browsers give this on https and on the box itself only. */
function stayAwake() {
  if (document.visibilityState === "visible") navigator.wakeLock?.request("screen").catch(() => {}); // as awake as the system has it
}
