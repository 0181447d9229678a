// Mouse, touch, keyboard, and the panel of what is shown.

const fingers = new Map();
let moved = 0, pinch = 0;

canvas.addEventListener("pointerdown", (event) => {
  canvas.setPointerCapture(event.pointerId);
  fingers.set(event.pointerId, [event.offsetX, event.offsetY]);
  moved = 0;
  pinch = 0;
  canvas.classList.add("dragging");
});

canvas.addEventListener("pointermove", (event) => {
  const before = fingers.get(event.pointerId);
  Object.assign(pointer, { px: event.offsetX, py: event.offsetY, over: true });
  if (before) {
    if (fingers.size === 1) {
      view.x -= (event.offsetX - before[0]) / view.scale;
      view.y += (event.offsetY - before[1]) / view.scale;
      moved += Math.abs(event.offsetX - before[0]) + Math.abs(event.offsetY - before[1]);
    }
    fingers.set(event.pointerId, [event.offsetX, event.offsetY]);
    if (fingers.size === 2) pinchZoom();
    redraw();
  }
  hover();
});

function pinchZoom() {
  const [a, b] = [...fingers.values()], apart = Math.hypot(a[0] - b[0], a[1] - b[1]);
  if (pinch) zoomAt((a[0] + b[0]) / 2, (a[1] + b[1]) / 2, apart / pinch);
  pinch = apart;
  moved += 10;
}

function release(event) {
  if (!fingers.delete(event.pointerId)) return;
  pinch = 0;
  if (!fingers.size) canvas.classList.remove("dragging");
  if (event.type === "pointerup" && moved < 5) {
    Object.assign(pointer, { px: event.offsetX, py: event.offsetY, over: true });
    hover();
    if (ruler.on) rulerClick();
  }
}
canvas.addEventListener("pointerup", release);
canvas.addEventListener("pointercancel", release);
canvas.addEventListener("pointerleave", () => { pointer.over = false; hover(); });
canvas.addEventListener("dblclick", (event) => { if (!ruler.on) zoomAt(event.offsetX, event.offsetY, 2); });
canvas.addEventListener("contextmenu", (event) => { event.preventDefault(); copyPlace(); });
canvas.addEventListener("wheel", (event) => {
  event.preventDefault();
  const lines = event.deltaMode === 1 ? 16 : 1;
  zoomAt(event.offsetX, event.offsetY, Math.exp(-event.deltaY * lines * 0.0015));
  hover();
}, { passive: false });

$("menu").addEventListener("click", () => {
  const open = $("panel").classList.toggle("open");
  $("menu").setAttribute("aria-expanded", open);
});

const toggles = {}; // key -> function
function addToggle(text, key, get, set) {
  const label = document.createElement("label"), box = document.createElement("input");
  box.type = "checkbox";
  box.checked = get();
  box.addEventListener("change", () => { set(box.checked); redraw(); });
  label.append(box, text);
  addKey(label, key, () => box.click());
  $("panel").append(label);
}
function addButton(text, key, id, action) {
  const button = document.createElement("button");
  button.id = id;
  button.textContent = text;
  button.addEventListener("click", action);
  addKey(button, key, action);
  $("panel").append(button);
}
function addKey(element, key, action) {
  if (!key) return;
  const mark = document.createElement("kbd");
  mark.textContent = key;
  element.append(mark);
  toggles[key] = action;
}

levels.forEach((level, k) => {
  const points = level.weights.length.toLocaleString("en");
  const key = levels.length < 10 ? String(k + 1) : "";
  addToggle(`${metres(level.step)}, ${points} points`, key, () => level.shown, (on) => { level.shown = on; });
});
$("panel").append(document.createElement("hr"));
const addShown = (text, key, name) => addToggle(text, key, () => shown[name], (on) => { shown[name] = on; });
if (path) addShown("path", "p", "path");
if (scans) addShown("scan", "s", "scan");
addShown("control points", "k", "points");
addShown("normals, free side", "n", "normals");
$("panel").append(document.createElement("hr"));
addButton("measure", "m", "measure", () => measure(!ruler.on));
addButton("copy place", "c", "copy", copyPlace);
addButton("fit", "0", "fit", fit);
addButton("light / dark", "d", "theme", () => {
  setTheme(document.documentElement.dataset.theme === "dark" ? "light" : "dark");
});

window.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const typing = ["SELECT", "INPUT"].includes(event.target.tagName) && event.target.type !== "checkbox";
  const pan = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
  if (pan && !typing) {
    view.x += (pan[0] * 60) / view.scale;
    view.y += (pan[1] * 60) / view.scale;
    redraw();
  } else if (event.key === "+" || event.key === "=") zoomAt(view.width / 2, view.height / 2, 1.3);
  else if (event.key === "-") zoomAt(view.width / 2, view.height / 2, 1 / 1.3);
  else if (event.key === " " && path && event.target.tagName !== "BUTTON") play(!player.playing);
  else if (event.key === "Escape") measure(false);
  else if (toggles[event.key.toLowerCase()] && !typing) toggles[event.key.toLowerCase()]();
  else return;
  event.preventDefault();
  hover();
});

$("summary").textContent = data.summary;
if (path && path.count > 1) {
  $("player").hidden = false;
  $("time").max = path.count - 1;
  $("time").addEventListener("input", () => { play(false); setPose(+$("time").value); });
  $("play").addEventListener("click", () => play(!player.playing));
}
new ResizeObserver(resize).observe(canvas);
const darkly = window.matchMedia("(prefers-color-scheme: dark)");
darkly.addEventListener("change", () => setTheme(darkly.matches ? "dark" : "light"));
resize();
setTheme(darkly.matches ? "dark" : "light");
if (path) { setPose(0); play(false); }
fit();
// for scripts that drive the page
window.bsmap = { view, frames, player, ruler, levels, fit, zoomAt, setPose, draw };
