// Where the window looks: map metres to pixels and back, and the frame loop.

const canvas = $("map"), context = canvas.getContext("2d");
const view = { x: 0, y: 0, scale: 40, width: 1, height: 1 }; // centre [m], pixels a metre
const shown = { path: true, points: false, normals: false, scan: true };
let colours = {}, waiting = false, fitted = null;

const toX = (x) => (x - view.x) * view.scale + view.width / 2;
const toY = (y) => view.height / 2 - (y - view.y) * view.scale;
const fromX = (px) => (px - view.width / 2) / view.scale + view.x;
const fromY = (py) => (view.height / 2 - py) / view.scale + view.y;

function redraw() {
  if (waiting) return;
  waiting = true;
  requestAnimationFrame(() => { waiting = false; draw(); });
}

function zoomAt(px, py, factor) {
  const x = fromX(px), y = fromY(py);
  view.scale = Math.min(Math.max(view.scale * factor, 1e-3), 1e6);
  view.x = x - (px - view.width / 2) / view.scale;
  view.y = y + (py - view.height / 2) / view.scale;
  redraw();
}

function mapBox() {
  let box = [Infinity, Infinity, -Infinity, -Infinity];
  const grow = (b) => {
    box = [Math.min(box[0], b[0]), Math.min(box[1], b[1]), Math.max(box[2], b[2]), Math.max(box[3], b[3])];
  };
  for (const level of levels) if (level.shown) level.pieces.forEach((piece) => grow(piece.box));
  if (path) for (let i = 0; i < path.count; i++) {
    const x = path.pose[3 * i], y = path.pose[3 * i + 1];
    grow([x, y, x, y]);
  }
  return box[0] <= box[2] ? box : [-1, -1, 1, 1];
}

function fit() { // into what the panel and the footer leave free
  const [x0, y0, x1, y1] = mapBox(), panel = $("panel").offsetWidth;
  const beside = panel && view.width > 3 * panel ? panel + 12 : 0;
  const width = Math.max(view.width - beside, 50), height = Math.max(view.height - 150, 50);
  view.scale = 0.94 * Math.min(width / Math.max(x1 - x0, 1e-3), height / Math.max(y1 - y0, 1e-3));
  view.x = (x0 + x1 + beside / view.scale) / 2;
  view.y = (y0 + y1) / 2 - 20 / view.scale;
  fitted = { x: view.x, y: view.y, scale: view.scale };
  redraw();
}

function resize() {
  const ratio = window.devicePixelRatio || 1;
  view.width = canvas.clientWidth;
  view.height = canvas.clientHeight;
  canvas.width = Math.round(view.width * ratio);
  canvas.height = Math.round(view.height * ratio);
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  const asFitted = fitted && Object.keys(fitted).every((key) => view[key] === fitted[key]);
  if (asFitted) fit(); // a turned phone still shows the whole map
  else redraw();
}

function readColours() {
  const style = getComputedStyle(document.documentElement);
  for (const name of ["ground", "ink", "soft", "path", "scan", "mark", "grid", "w0", "w1", "w2", "w3", "w4"]) {
    colours[name] = style.getPropertyValue(`--${name}`).trim();
  }
  redraw();
}

function setTheme(name) {
  document.documentElement.dataset.theme = name;
  readColours();
}
