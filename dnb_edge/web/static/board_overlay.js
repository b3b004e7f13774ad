// What the overlay's address asks for: ?corner=bottom-right&scale=1.5&map=off. Over a picture it is always dark.

const asked = new URLSearchParams(location.search);
const corner = asked.get("corner") ?? "";
const scale = Number(asked.get("scale") ?? 1);

document.documentElement.dataset.theme = "dark";
if (/^(top|bottom)-(left|right)$/.test(corner)) document.body.dataset.corner = corner;
if (asked.get("map") === "off") document.body.dataset.map = "off";
if (scale >= 0.5 && scale <= 4) document.body.style.setProperty("--scale", `${scale}rem`);
