// The map of the page: arrays out of base64, curves as polylines, and what lies where.

const $ = (id) => document.getElementById(id);
const data = JSON.parse($("data").textContent);
const PARTS = 4; // chords a span

function unpack(text, Type) {
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  return new Type(bytes.buffer);
}

// One drawn piece: samples [first, last) of the level, its box, its curve and weight class.
function buildLevel(raw) {
  const level = {
    step: raw.step, shown: raw.shown, ids: unpack(raw.ids, Uint32Array),
    counts: unpack(raw.counts, Uint32Array), flags: unpack(raw.flags, Uint16Array),
    seen: unpack(raw.seen, Uint16Array), xy: unpack(raw.xy, Float32Array),
    weights: unpack(raw.weights, Uint8Array), pieces: [],
  };
  const owners = unpack(raw.piece_curves, Uint32Array);
  const bounds = unpack(raw.piece_bounds, Float64Array); // from, to in knot steps of the domain
  const offsets = [0];
  for (const count of level.counts) offsets.push(offsets[offsets.length - 1] + count);
  level.offsets = offsets;
  let total = 0;
  for (let k = 0; k < owners.length; k++) total += sampleCount(bounds[2 * k], bounds[2 * k + 1]);
  level.x = new Float32Array(total);
  level.y = new Float32Array(total);
  let at = 0;
  owners.forEach((curve, k) => {
    const piece = { curve, first: at, weight: 0, length: 0 };
    at = samplePiece(level, piece, offsets[curve], bounds[2 * k], bounds[2 * k + 1], at);
    piece.last = at;
    finishPiece(level, piece);
    level.pieces.push(piece);
  });
  level.meanWeights = Array.from(level.ids, (_, k) => {
    const own = level.weights.subarray(offsets[k], offsets[k + 1]).filter((w) => w > 0);
    return own.reduce((a, b) => a + b, 0) / Math.max(own.length, 1);
  });
  for (const piece of level.pieces) {
    const share = level.meanWeights[piece.curve] / Math.max(data.max_weight, 1);
    piece.kind = Math.min(4, Math.floor(share * 5));
  }
  return level;
}

function sampleCount(from, to) {
  return Math.max(1, Math.ceil((to - from) * PARTS - 1e-6)) + 1;
}

function samplePiece(level, piece, row, from, to, at) {
  const count = sampleCount(from, to), degree = data.degree, m = data.matrix;
  const domain = level.counts[piece.curve] - degree;
  for (let i = 0; i < count; i++) {
    const u = from + ((to - from) * i) / (count - 1);
    const span = Math.min(Math.max(Math.floor(u), 0), domain - 1), f = u - span;
    let x = 0, y = 0;
    for (let a = 0; a <= degree; a++) {
      let b = 0;
      for (let p = degree; p >= 0; p--) b = b * f + m[a][p];
      x += b * level.xy[2 * (row + span + a)];
      y += b * level.xy[2 * (row + span + a) + 1];
    }
    level.x[at] = x;
    level.y[at] = y;
    at++;
  }
  return at;
}

function finishPiece(level, piece) {
  let x0 = Infinity, y0 = Infinity, x1 = -Infinity, y1 = -Infinity;
  for (let i = piece.first; i < piece.last; i++) {
    const x = level.x[i], y = level.y[i];
    x0 = Math.min(x0, x); x1 = Math.max(x1, x); y0 = Math.min(y0, y); y1 = Math.max(y1, y);
    if (i > piece.first) piece.length += Math.hypot(x - level.x[i - 1], y - level.y[i - 1]);
  }
  piece.box = [x0, y0, x1, y1];
}

// Samples hashed into square cells, for hovering.
function buildIndex(level) {
  const cell = Math.max(10 * level.step, 1e-6), cells = new Map();
  level.pieces.forEach((piece, k) => {
    for (let i = piece.first; i < piece.last; i++) {
      const key = `${Math.floor(level.x[i] / cell)},${Math.floor(level.y[i] / cell)}`;
      let list = cells.get(key);
      if (!list) cells.set(key, (list = []));
      list.push(i, k);
    }
  });
  return { cell, cells };
}

function nearestSample(x, y, reach) {
  let best = null;
  for (const level of levels) {
    if (!level.shown) continue;
    level.index = level.index || buildIndex(level);
    const { cell, cells } = level.index;
    const c0 = Math.floor((x - reach) / cell), c1 = Math.floor((x + reach) / cell);
    const r0 = Math.floor((y - reach) / cell), r1 = Math.floor((y + reach) / cell);
    if ((c1 - c0 + 1) * (r1 - r0 + 1) > 4000) continue;
    for (let c = c0; c <= c1; c++) {
      for (let r = r0; r <= r1; r++) {
        const list = cells.get(`${c},${r}`) || [];
        for (let i = 0; i < list.length; i += 2) {
          const d = Math.hypot(level.x[list[i]] - x, level.y[list[i]] - y);
          if (d < reach && (!best || d < best.distance)) {
            best = { distance: d, level, piece: level.pieces[list[i + 1]], sample: list[i] };
          }
        }
      }
    }
  }
  return best;
}

const levels = data.levels.map(buildLevel);
const path = data.path && {
  count: data.path.count, every: data.path.every, pose: unpack(data.path.poses, Float32Array),
  seconds: data.path.seconds ? unpack(data.path.seconds, Float32Array) : null,
};
const scans = data.scans && {
  poses: unpack(data.scans.poses, Uint32Array), counts: unpack(data.scans.counts, Uint32Array),
  points: unpack(data.scans.points, Int16Array), quantum: data.scans.quantum, offsets: [0],
};
if (scans) for (const n of scans.counts) scans.offsets.push(scans.offsets[scans.offsets.length - 1] + n);
