// Hovering, measuring, copying, and playing the path.

let hovered = null;
const ruler = { on: false, start: null, end: null };
const pointer = { px: 0, py: 0, over: false };
const player = { at: 0, playing: false, exact: 0, before: 0 };
const PLAY_SECONDS = 60; // for the whole path at speed 1

function hover() {
  const x = fromX(pointer.px), y = fromY(pointer.py);
  $("place").textContent = pointer.over ? `${x.toFixed(3)}, ${y.toFixed(3)} m` : "";
  const before = hovered && hovered.piece;
  hovered = pointer.over ? nearestSample(x, y, 10 / view.scale) : null;
  const tip = $("tip");
  tip.hidden = !hovered;
  if (hovered) {
    tip.textContent = figures(hovered);
    tip.style.left = `${Math.min(pointer.px + 16, view.width - tip.offsetWidth - 8)}px`;
    tip.style.top = `${Math.min(pointer.py + 16, view.height - tip.offsetHeight - 8)}px`;
  }
  if (before !== (hovered && hovered.piece) || ruler.on) redraw();
}

function figures({ level, piece }) {
  const k = piece.curve, flags = level.flags[k];
  const length = level.pieces.reduce((sum, other) => sum + (other.curve === k ? other.length : 0), 0);
  const words = [flags & 1 ? "closed" : "", flags & 2 ? "tentative" : ""].filter(Boolean);
  return [
    `curve ${level.ids[k]}${words.length ? ` (${words.join(", ")})` : ""}`,
    `knot step ${metres(level.step)}, ${level.counts[k]} control points`,
    `${metres(length)} long, weight ${level.meanWeights[k].toFixed(1)} of ${data.max_weight}`,
    `seen ${level.seen[k]} times`,
  ].join("\n");
}

function measure(on) {
  ruler.on = on;
  ruler.start = ruler.end = null;
  canvas.classList.toggle("measuring", on);
  $("measure").setAttribute("aria-pressed", on);
  redraw();
}

function rulerClick() {
  const point = hovered
    ? [hovered.level.x[hovered.sample], hovered.level.y[hovered.sample]] // snap to curves
    : [fromX(pointer.px), fromY(pointer.py)];
  if (!ruler.start || ruler.end) { ruler.start = point; ruler.end = null; } else ruler.end = point;
  redraw();
}

function drawTool() {
  if (!ruler.on || !ruler.start) return;
  const [x, y] = ruler.end || [fromX(pointer.px), fromY(pointer.py)], [x0, y0] = ruler.start;
  context.strokeStyle = context.fillStyle = colours.mark;
  context.lineWidth = 1.5;
  context.beginPath();
  context.moveTo(toX(x0), toY(y0));
  context.lineTo(toX(x), toY(y));
  context.stroke();
  for (const [a, b] of [ruler.start, [x, y]]) context.fillRect(toX(a) - 3, toY(b) - 3, 6, 6);
  const angle = (Math.atan2(y - y0, x - x0) * 180) / Math.PI;
  const text = `${metres(Math.hypot(x - x0, y - y0))}  ${angle.toFixed(1)}\u00b0`;
  context.font = "600 14px system-ui, sans-serif";
  const px = (toX(x0) + toX(x)) / 2 + 10, py = (toY(y0) + toY(y)) / 2 - 10;
  context.strokeStyle = colours.ground;
  context.lineWidth = 4;
  context.strokeText(text, px, py);
  context.fillText(text, px, py);
}

function copyPlace() {
  const text = `${fromX(pointer.px).toFixed(4)}, ${fromY(pointer.py).toFixed(4)}`;
  const said = () => { $("place").textContent = `copied ${text}`; };
  const byHand = () => {
    const area = document.createElement("textarea");
    area.value = text;
    document.body.append(area);
    area.select();
    document.execCommand("copy");
    area.remove();
    said();
  };
  if (navigator.clipboard) navigator.clipboard.writeText(text).then(said, byHand); else byHand();
}

function setPose(at) {
  player.at = Math.min(Math.max(Math.round(at), 0), path.count - 1);
  $("time").value = player.at;
  const seconds = path.seconds && path.seconds[player.at];
  const pad = (n) => String(n).padStart(2, "0");
  const minutes = path.seconds && `${Math.floor(seconds / 60)}:${pad(Math.floor(Math.abs(seconds) % 60))}`;
  const pose = `pose ${player.at * path.every + 1}`; // of a long path only some poses are here
  $("clock").textContent = minutes ? `${minutes}  ${pose}` : pose;
  redraw();
}

function play(on) {
  player.playing = on;
  $("play").textContent = on ? "\u23f8" : "\u25b6";
  $("play").setAttribute("aria-label", on ? "Pause" : "Play");
  if (!on) return;
  if (player.at >= path.count - 1) setPose(0);
  player.exact = player.at;
  player.before = performance.now();
  requestAnimationFrame(advance);
}

function advance(now) {
  if (!player.playing) return;
  const speed = +$("speed").value * (path.count / PLAY_SECONDS);
  player.exact += (Math.max(now - player.before, 0) / 1000) * speed;
  player.before = now;
  setPose(player.exact);
  if (player.exact >= path.count - 1) play(false); else requestAnimationFrame(advance);
}
