// Draws a table and its balls on a canvas. The data are those of `drawing.page`: the size of the picture in m, colours,
// the shapes of the table, the marks and the light of the balls, and the looks of the balls.
function painter(canvas, { view: [wide, high, strip], shapes, style, tray, balls }) {
const pen = canvas.getContext("2d");
const outlines = shapes.map(([colour, corners]) => {
  const outline = new Path2D();
  for (let k = 0; k < corners.length; k += 2) outline.lineTo(corners[k], corners[k + 1]);
  outline.closePath();
  return [colour, outline];
});
const ground = document.createElement("canvas");
let scale = 1;
function fit() {
  const ratio = window.devicePixelRatio || 1, room = canvas.parentElement;
  const width = Math.max(1, Math.min(room.clientWidth, room.clientHeight * wide / high));
  canvas.style.width = width + "px"; canvas.style.height = width * high / wide + "px";
  const changed = canvas.width !== Math.round(width * ratio);
  if (changed) { canvas.width = Math.round(width * ratio); canvas.height = Math.round(canvas.width * high / wide); }
  scale = canvas.width / wide;
  if (changed || !ground.drawn) paintTable();
  place0(pen);
}
const place0 = pen => pen.setTransform(scale, 0, 0, -scale, canvas.width / 2, (high - strip) / 2 * scale);

// Random numbers that are the same every time.
function noise(seed) { return () => (seed = (Math.imul(seed, 1664525) + 1013904223) >>> 0) / 4294967296; }
function grain(width, height) {
  const wood = document.createElement("canvas"), ink = wood.getContext("2d"), random = noise(7);
  wood.width = width; wood.height = height;
  for (let k = 0; k < 2.2 * height; k++) {
    const y = random() * height, long = (0.15 + random()) * width, x = random() * (width + long) - long;
    ink.fillStyle = random() < 0.6 ? `rgba(20,8,0,${0.05 + 0.13 * random()})` : `rgba(255,190,120,${0.03 + 0.07 * random()})`;
    ink.fillRect(x, y, long, 0.6 + 1.6 * random());
  }
  return wood;
}
function weave() {
  const cloth = document.createElement("canvas"), ink = cloth.getContext("2d"), random = noise(3);
  cloth.width = cloth.height = 256;
  const dots = ink.createImageData(256, 256);
  for (let k = 0; k < dots.data.length; k += 4) { dots.data.fill(random() < 0.5 ? 0 : 255, k, k + 3); dots.data[k + 3] = 7 * random(); }
  ink.putImageData(dots, 0, 0);
  return cloth;
}
// The empty table: wood, cloth and shadows on the shapes of style.py.
function paintTable() {
  ground.width = canvas.width; ground.height = canvas.height; ground.drawn = true;
  const pen = ground.getContext("2d"), half = [wide / 2, (high - strip) / 2];
  place0(pen);
  const clipped = (path, rule, paint) => { pen.save(); pen.clip(path, rule); paint(); pen.restore(); };
  const [, cloth] = outlines.find(([colour]) => colour === style.cloth);
  const fill = (colour, outline) => {
    pen.fillStyle = colour; pen.fill(outline);
    if (colour === style.cushion) clipped(outline, "nonzero", () => {
      for (const width of [0.008, 0.018, 0.03]) { pen.strokeStyle = "rgba(255,255,255,0.07)"; pen.lineWidth = width; pen.stroke(cloth); }
    });
  };
  for (const [colour, outline] of outlines) {
    fill(colour, outline);
    if (colour === style.rail) clipped(outline, "nonzero", () => {
      const wood = grain(Math.max(2, Math.round(2 * half[0] * scale)), Math.max(2, Math.round(2 * half[1] * scale)));
      for (const turn of [0, 1]) {
        pen.save();
        pen.beginPath();
        for (const s of [1, -1]) { // the joints of the rails run at 45 degrees from the corners
          const way = half[0] - half[1], points = turn
            ? [[s * half[0], half[1]], [s * half[0], -half[1]], [s * way, 0]]
            : [[half[0], s * half[1]], [-half[0], s * half[1]], [-way, 0], [way, 0]];
          points.forEach((point, k) => k ? pen.lineTo(...point) : pen.moveTo(...point));
          pen.closePath();
        }
        pen.clip();
        if (turn) pen.rotate(Math.PI / 2);
        pen.drawImage(wood, -half[0], -half[0], 2 * half[0], 2 * half[0]);
        pen.restore();
      }
      for (const [x0, y0, x1, y1] of [[0, 1, 0, -1], [-1, 0, 1, 0]]) {
        const shine = pen.createLinearGradient(x0 * half[0], y0 * half[1], x1 * half[0], y1 * half[1]);
        shine.addColorStop(0, "rgba(255,220,170,0.10)"); shine.addColorStop(0.06, "rgba(255,220,170,0)");
        shine.addColorStop(0.94, "rgba(0,0,0,0)"); shine.addColorStop(1, "rgba(0,0,0,0.28)");
        pen.fillStyle = shine; pen.fillRect(-half[0], -half[1], 2 * half[0], 2 * half[1]);
      }
    });
    if (colour === style.cloth) {
      clipped(outline, "nonzero", () => {
        pen.save(); pen.setTransform(1, 0, 0, 1, 0, 0);
        pen.fillStyle = pen.createPattern(weave(), "repeat"); pen.fillRect(0, 0, ground.width, ground.height);
        pen.restore();
        const lamp = pen.createRadialGradient(0, 0, 0.1 * half[0], 0, 0, 1.15 * half[0]);
        lamp.addColorStop(0, "rgba(255,255,255,0.018)"); lamp.addColorStop(0.5, "rgba(0,0,0,0)"); lamp.addColorStop(1, "rgba(0,0,0,0.10)");
        pen.fillStyle = lamp; pen.fillRect(-half[0], -half[1], 2 * half[0], 2 * half[1]);
      });
    }
  }
  // The shadow of the cushions on the cloth. Canvas shadows ignore the transform, so the offset is in pixels.
  const around = new Path2D();
  around.rect(-2 * half[0], -2 * half[1], 4 * half[0], 4 * half[1]); around.addPath(cloth);
  clipped(cloth, "nonzero", () => {
    pen.shadowColor = "rgba(0,0,0,0.55)"; pen.shadowBlur = 0.022 * scale; pen.shadowOffsetX = 0.005 * scale; pen.shadowOffsetY = 0.007 * scale;
    pen.fillStyle = style.cushion_edge; pen.fill(around, "evenodd");
  });
  for (const shape of outlines.slice(outlines.findIndex(([, one]) => one === cloth) + 1)) fill(...shape);
}

// The map of a ball's surface as in spheres.py: an equal-area projection of each half.
const rgb = colour => [1, 3, 5].map(k => parseInt(colour.slice(k, k + 2), 16));
function glyph(text, size) {
  const paper = document.createElement("canvas"), ink = paper.getContext("2d", { willReadFrequently: true });
  paper.width = paper.height = size;
  ink.font = `bold ${(text.length > 1 ? 0.36 : 0.44) * size}px system-ui, sans-serif`; ink.textAlign = "center"; ink.textBaseline = "middle";
  ink.fillText(text, size / 2, 0.52 * size);
  return ink.getImageData(0, 0, size, size).data;
}
function faceOf(look, size) {
  const map = new Uint8Array(2 * size * size * 3), fill = rgb(look.fill), white = rgb(style.chalk), ink = rgb(style.ink), dots = look.dots ? rgb(look.dots) : null;
  const letters = look.dots || !look.number ? null : glyph(look.number, size), sharp = size / 2.8;
  const share = value => Math.min(1, Math.max(0, value * sharp + 0.5));
  let k = 0;
  for (const sign of [1, -1]) for (let row = 0; row < size; row++) for (let column = 0; column < size; column++, k += 3) {
    const u = 2 * (column + 0.5) / size - 1, v = 1 - 2 * (row + 0.5) / size, square = Math.min(u * u + v * v, 1), stretch = Math.sqrt(2 - square);
    const x = u * stretch, y = v * stretch, z = sign * (1 - square);
    const colour = look.striped ? [...white] : [...fill];
    const mix = (part, other) => { for (let c = 0; c < 3; c++) colour[c] += part * (other[c] - colour[c]); };
    if (look.striped) mix(share(style.stripe - Math.abs(y)), fill);
    if (dots) for (const [a, b, c] of style.dots) mix(share(look.dot - Math.acos(Math.min(1, Math.max(-1, a * x + b * y + c * z)))), dots);
    else {
      mix(share(style.disc - Math.hypot(x, y)), white);
      if (letters && Math.hypot(x, y) < style.disc) {
        const i = Math.floor((0.5 + 0.5 * sign * x) * size), j = Math.floor((0.5 - 0.5 * y) * size);
        mix(letters[4 * (j * size + i) + 3] / 255, ink);
      }
    }
    map.set(colour, k);
  }
  return map;
}
const maps = new Map();
function mapOf(ball, radius) {
  const size = Math.min(256, Math.max(32, 2 ** Math.ceil(Math.log2(3.5 * radius)))), key = ball + " " + size;
  if (!maps.has(key)) maps.set(key, [faceOf(balls[ball], size), size]);
  return maps.get(key);
}
// A ball as a shaded sphere, four samples per pixel, at a point in pixels of the canvas.
const sheet = document.createElement("canvas"), sheetPen = sheet.getContext("2d");
function paintBall(ball, cx, cy, radius, q) {
  const [map, size] = mapOf(ball, radius), left = Math.floor(cx - radius - 1), top = Math.floor(cy - radius - 1), side = Math.ceil(2 * radius) + 3;
  const [w, x, y, z] = q, lamp = style.light, shine = style.shine, image = sheetPen.createImageData(side, side), out = image.data;
  const m = [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y), 2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x), 2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)];
  for (let row = 0; row < side; row++) for (let column = 0; column < side; column++) {
    let red = 0, green = 0, blue = 0, seen = 0;
    for (let s = 0; s < 4; s++) {
      const nx = (left + column + 0.25 + 0.5 * (s & 1) - cx) / radius, ny = -(top + row + 0.25 + 0.5 * (s >> 1) - cy) / radius, square = nx * nx + ny * ny;
      if (square >= 1) continue;
      const nz = Math.sqrt(1 - square), a = m[0] * nx + m[1] * ny + m[2] * nz, b = m[3] * nx + m[4] * ny + m[5] * nz, c = m[6] * nx + m[7] * ny + m[8] * nz;
      const stretch = 0.499 * size / Math.sqrt(1 + Math.abs(c));
      const k = 3 * (((c < 0 ? size : 0) + Math.floor(0.5 * size - b * stretch)) * size + Math.floor(0.5 * size + a * stretch));
      const light = Math.min(1, Math.max(style.darkest, style.ambient + style.diffuse * (nx * lamp[0] + ny * lamp[1] + nz * lamp[2])));
      const glint = 255 * style.shine_light * Math.max(0, nx * shine[0] + ny * shine[1] + nz * shine[2]) ** style.shine_power;
      red += map[k] * light + glint; green += map[k + 1] * light + glint; blue += map[k + 2] * light + glint; seen++;
    }
    if (seen) { const k = 4 * (row * side + column); out[k] = red / seen; out[k + 1] = green / seen; out[k + 2] = blue / seen; out[k + 3] = 63.75 * seen; }
  }
  if (sheet.width < side) sheet.width = sheet.height = side;
  sheetPen.clearRect(0, 0, sheet.width, sheet.height); sheetPen.putImageData(image, 0, 0);
  pen.save(); pen.setTransform(1, 0, 0, 1, 0, 0); pen.drawImage(sheet, 0, 0, side, side, left, top, side, side); pen.restore();
}
function disc(x, y, radius, colour) { pen.beginPath(); pen.arc(x, y, radius, 0, 2 * Math.PI); pen.fillStyle = colour; pen.fill(); }
function write(text, x, y, size, colour, align) {
  pen.save(); pen.translate(x, y); pen.scale(size / 10, -size / 10);
  pen.font = "bold 10px system-ui, sans-serif"; pen.textAlign = align; pen.textBaseline = "middle"; pen.fillStyle = colour; pen.fillText(text, 0, 0.5); pen.restore();
}
function drawTable() {
  pen.save(); pen.setTransform(1, 0, 0, 1, 0, 0);
  pen.clearRect(0, 0, canvas.width, canvas.height); pen.drawImage(ground, 0, 0);
  pen.restore();
}
// A ball at a height z above the cloth is larger, and its shadow is farther away, wider and fainter.
function drawBall(ball, x, y, radius, q = [1, 0, 0, 0], z = 0) {
  const { e, f } = pen.getTransform();
  paintBall(ball, e + scale * x, f - scale * y, scale * radius * (1 + style.lift * z), q);
}
function drawShadow(x, y, radius, z = 0) {
  const [dx, dy] = style.shadow, [lx, ly, lz] = style.light, wide = 1 + style.spread * z / radius, dark = style.shadow_dark / wide ** 2;
  const [begin, end] = style.shadow_reach.map(reach => reach * wide), cx = x + dx * radius - lx / lz * z, cy = y + dy * radius - ly / lz * z;
  const fade = pen.createRadialGradient(cx, cy, begin * radius, cx, cy, end * radius);
  for (const part of [0, 0.25, 0.5, 0.75, 1]) fade.addColorStop(part, `rgba(0,0,0,${dark * (1 - part * part * (3 - 2 * part))})`);
  pen.fillStyle = fade; pen.beginPath(); pen.arc(cx, cy, end * radius, 0, 2 * Math.PI); pen.fill();
}
function drawTray(isPotted) {
  if (!strip) return;
  const { radius, half, x } = tray, y = -high / 2;
  write(style.potted, -half - radius, y, 0.5 * strip, getComputedStyle(document.body).color, "right");
  pen.beginPath(); pen.roundRect(-half, y - 1.35 * radius, 2 * half, 2.7 * radius, 1.35 * radius); pen.fillStyle = style.rail; pen.fill();
  let slot = 0;
  balls.forEach((_, ball) => { if (isPotted(ball)) drawBall(ball, x[slot++], y, radius); });
}
return { pen, fit, drawTable, drawBall, drawShadow, drawTray, disc, get scale() { return scale; } };
}
