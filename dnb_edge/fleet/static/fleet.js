// Fetches the page again every two seconds and puts its content in the place of what is shown. The server makes the whole page,
// so there is one place that says how a box looks.
const EVERY_MS = 2000;
const stale = document.getElementById("stale");

async function renew() {
  const answer = await fetch(location.href, { headers: { Accept: "text/html" }, cache: "no-store" });
  if (!answer.ok) throw new Error(String(answer.status));
  const page = new DOMParser().parseFromString(await answer.text(), "text/html");
  const fresh = page.getElementById("main");
  const main = document.getElementById("main");
  // Whoever goes over the page with the keyboard, or marks something, is not disturbed.
  if (main.contains(document.activeElement) && document.activeElement !== main) return;
  if (!getSelection().isCollapsed || main.innerText === fresh.innerText) return;
  main.replaceChildren(...[...fresh.childNodes].map((node) => document.importNode(node, true)));
}

async function goOn() {
  try {
    if (!document.hidden) await renew();
    stale.hidden = true;
  } catch {
    stale.hidden = false;
  }
  setTimeout(goOn, EVERY_MS);
}

setTimeout(goOn, EVERY_MS);
