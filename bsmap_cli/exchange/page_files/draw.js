// Painting: only what is in the window, and no finer than pixels can show.

const CHORD = 3; // pixels between drawn samples
const MANY = 3000; // pieces in the window from which on speed comes before beauty

function draw() {
  context.fillStyle = colours.ground;
  context.fillRect(0, 0, view.width, view.height);
  drawGrid();
  const window_ = [fromX(0), fromY(view.height), fromX(view.width), fromY(0)];
  for (const level of levels) if (level.shown) drawLevel(level, window_);
  if (shown.path && path) drawPath();
  if (path && shown.path) drawRobot();
  drawTool();
  drawScale();
  frames.count++;
}

const frames = { count: 0 };

function visible(piece, box) {
  const b = piece.box;
  return b[0] <= box[2] && b[2] >= box[0] && b[1] <= box[3] && b[3] >= box[1];
}

function drawLevel(level, box) {
  const stride = Math.max(1, Math.floor((CHORD * PARTS) / (level.step * view.scale)));
  const inside = level.pieces.filter((piece) => visible(piece, box));
  // lines of one device pixel are drawn ten times as fast as wider ones
  const thin = inside.length > MANY ? 1 / (window.devicePixelRatio || 1) : 1;
  context.lineWidth = Math.min(3, Math.max(thin, view.scale * 0.012));
  const near = level.step * view.scale > 12; // round ends cost time and are not seen from afar
  context.lineJoin = near ? "round" : "bevel";
  context.lineCap = near ? "round" : "butt";
  for (let kind = 0; kind < 5; kind++) {
    context.strokeStyle = colours[`w${kind}`];
    context.beginPath();
    for (const piece of inside) if (piece.kind === kind) tracePiece(level, piece, stride);
    context.stroke();
  }
  if (hovered && hovered.level === level) {
    context.strokeStyle = colours.mark;
    context.lineWidth += 1.5;
    context.beginPath();
    for (const piece of inside) if (piece.curve === hovered.piece.curve) tracePiece(level, piece, stride);
    context.stroke();
  }
  if (shown.normals) drawNormals(level, inside);
  if (shown.points) drawPoints(level, inside, box);
}

function tracePiece(level, piece, stride) {
  const last = piece.last - 1;
  context.moveTo(toX(level.x[piece.first]), toY(level.y[piece.first]));
  for (let i = piece.first + stride; i < last; i += stride) context.lineTo(toX(level.x[i]), toY(level.y[i]));
  context.lineTo(toX(level.x[last]), toY(level.y[last]));
}

function drawNormals(level, pieces) {
  const stride = Math.max(1, Math.ceil((14 * PARTS) / (level.step * view.scale)));
  context.strokeStyle = colours.soft;
  context.lineWidth = 0.8;
  context.beginPath();
  for (const piece of pieces) {
    for (let i = piece.first + (stride >> 1); i < piece.last - 1; i += stride) {
      const dx = level.x[i + 1] - level.x[i], dy = level.y[i + 1] - level.y[i];
      const norm = Math.hypot(dx, dy) || 1, px = toX(level.x[i]), py = toY(level.y[i]);
      context.moveTo(px, py);
      context.lineTo(px - (9 * dy) / norm, py - (9 * dx) / norm); // to the left, where it is free
    }
  }
  context.stroke();
}

let taken = new Uint8Array(0); // where a mark of this frame stands: one more would not be seen

function drawPoints(level, pieces, box) {
  const size = Math.min(2.2, Math.max(0.7, level.step * view.scale * 0.12));
  context.fillStyle = colours.path;
  const wide = 2 * size, across = Math.ceil(view.width / wide) + 1;
  const cells = across * (Math.ceil(view.height / wide) + 1);
  if (taken.length < cells) taken = new Uint8Array(cells); else taken.fill(0, 0, cells);
  const done = new Set();
  for (const piece of pieces) {
    if (done.has(piece.curve)) continue;
    done.add(piece.curve);
    for (let row = level.offsets[piece.curve]; row < level.offsets[piece.curve + 1]; row++) {
      const x = level.xy[2 * row], y = level.xy[2 * row + 1];
      if (x < box[0] || x > box[2] || y < box[1] || y > box[3]) continue;
      const px = toX(x), py = toY(y), cell = Math.floor(py / wide) * across + Math.floor(px / wide);
      if (taken[cell]) continue;
      taken[cell] = 1;
      context.fillRect(px - size, py - size, wide, wide);
    }
  }
}

function drawPath() {
  context.strokeStyle = colours.path;
  context.lineWidth = 1;
  context.globalAlpha = 0.75;
  context.beginPath();
  let lastX = Infinity, lastY = Infinity;
  for (let i = 0; i < path.count; i++) {
    const px = toX(path.pose[3 * i]), py = toY(path.pose[3 * i + 1]);
    if (i && i < path.count - 1 && Math.abs(px - lastX) + Math.abs(py - lastY) < 2) continue;
    if (i) context.lineTo(px, py); else context.moveTo(px, py);
    lastX = px; lastY = py;
  }
  context.stroke();
  context.globalAlpha = 1;
}

function drawRobot() {
  const i = player.at, x = path.pose[3 * i], y = path.pose[3 * i + 1], yaw = path.pose[3 * i + 2];
  if (scans && shown.scan) drawScan(i);
  const px = toX(x), py = toY(y), size = 9;
  const corner = (angle, r) => [px + r * Math.cos(yaw + angle), py - r * Math.sin(yaw + angle)];
  context.fillStyle = colours.path;
  context.beginPath();
  context.moveTo(...corner(0, size));
  context.lineTo(...corner(2.5, size));
  context.lineTo(...corner(Math.PI, 0.4 * size));
  context.lineTo(...corner(-2.5, size));
  context.fill();
}

function drawScan(at) {
  let low = 0, high = scans.poses.length;
  while (low < high) { // the last scan that is not later than the pose
    const middle = (low + high) >> 1;
    if (scans.poses[middle] <= at) low = middle + 1; else high = middle;
  }
  if (low === 0) return;
  const k = low - 1, pose = 3 * scans.poses[k];
  const x = path.pose[pose], y = path.pose[pose + 1];
  const cos = Math.cos(path.pose[pose + 2]), sin = Math.sin(path.pose[pose + 2]);
  context.fillStyle = colours.scan;
  for (let i = scans.offsets[k]; i < scans.offsets[k + 1]; i++) {
    const bx = scans.points[2 * i] * scans.quantum, by = scans.points[2 * i + 1] * scans.quantum;
    context.fillRect(toX(x + cos * bx - sin * by) - 1.2, toY(y + sin * bx + cos * by) - 1.2, 2.4, 2.4);
  }
}

function roundLength(length) {
  const power = 10 ** Math.floor(Math.log10(length) + 1e-12);
  for (const digit of [5, 2]) if (digit * power <= length * (1 + 1e-9)) return digit * power;
  return power;
}

function drawGrid() {
  const step = roundLength(120 / view.scale);
  context.strokeStyle = colours.grid;
  context.lineWidth = 1;
  context.beginPath();
  for (let x = Math.ceil(fromX(0) / step) * step; x < fromX(view.width); x += step) {
    context.moveTo(Math.round(toX(x)) + 0.5, 0);
    context.lineTo(Math.round(toX(x)) + 0.5, view.height);
  }
  for (let y = Math.ceil(fromY(view.height) / step) * step; y < fromY(0); y += step) {
    context.moveTo(0, Math.round(toY(y)) + 0.5);
    context.lineTo(view.width, Math.round(toY(y)) + 0.5);
  }
  context.stroke();
}

function metres(length) {
  if (length >= 0.9995) return `${+length.toPrecision(4)} m`;
  return length >= 0.01 ? `${+(100 * length).toPrecision(3)} cm` : `${+(1000 * length).toPrecision(3)} mm`;
}

function drawScale() {
  const length = roundLength(140 / view.scale), width = length * view.scale;
  $("scale").setAttribute("width", width + 2);
  $("scale").innerHTML = `<path d="M1 3v8m0-4h${width}m0-4v8" fill="none" stroke="${colours.soft}"/>`;
  $("scale-text").textContent = metres(length);
}
