// The one renderer: a canvas that is moved and magnified by pointer, wheel, touch and keys, and drawn
// only when something changed. A view gives it `draw(pen)`, `pick(x, y)` and `bounds()`.

export class Board {
  constructor(canvas, choose) {
    this.canvas = canvas;
    this.pen = canvas.getContext('2d');
    this.choose = choose;
    this.view = null;
    this.places = new Map(); // where each view was looked at
    this.pointers = new Map();
    this.due = false;
    new ResizeObserver(() => this.resize()).observe(canvas);
    canvas.addEventListener('wheel', (e) => { e.preventDefault(); this.zoom(Math.exp(-e.deltaY / 400), e.offsetX, e.offsetY); }, { passive: false });
    canvas.addEventListener('pointerdown', (e) => this.down(e));
    canvas.addEventListener('pointermove', (e) => this.move(e));
    for (const end of ['pointerup', 'pointercancel']) canvas.addEventListener(end, (e) => this.up(e));
    canvas.addEventListener('keydown', (e) => this.key(e));
    matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => { inks.clear(); this.redraw(); });
    this.resize();
  }

  show(view) {
    if (this.view) this.places.set(this.view, this.moved ? { ...this.at } : null);
    this.view = view;
    this.at = this.places.get(view) ?? null;
    this.moved = this.at !== null;
    this.redraw();
  }

  resize() {
    const ratio = window.devicePixelRatio || 1;
    const { clientWidth: w, clientHeight: h } = this.canvas;
    if (!w || !h) return;
    this.canvas.width = Math.round(w * ratio);
    this.canvas.height = Math.round(h * ratio);
    // What nobody has moved stays in sight as a whole.
    if (!this.moved) this.at = null;
    this.redraw();
  }

  fit() {
    this.moved = false;
    const box = this.view.bounds();
    const { clientWidth: w, clientHeight: h } = this.canvas;
    if (!box || !w || !h) return;
    const [x0, y0, x1, y1] = box;
    const scale = Math.min(w / (x1 - x0 || 1), h / (y1 - y0 || 1)) * 0.94;
    this.at = { scale, x: w / 2 - (scale * (x0 + x1)) / 2, y: h / 2 - (scale * (y0 + y1)) / 2 };
  }

  // Brings a place of the view to the middle.
  centre(x, y) {
    if (!this.at) this.fit();
    if (!this.at) return;
    const { clientWidth: w, clientHeight: h } = this.canvas;
    this.moved = true;
    this.at.scale = Math.max(this.at.scale, 1);
    this.at.x = w / 2 - this.at.scale * x;
    this.at.y = h / 2 - this.at.scale * y;
    this.redraw();
  }

  zoom(factor, x, y) {
    if (!this.at) return;
    this.moved = true;
    const scale = Math.min(Math.max(this.at.scale * factor, 0.01), 800);
    this.at.x = x - ((x - this.at.x) * scale) / this.at.scale;
    this.at.y = y - ((y - this.at.y) * scale) / this.at.scale;
    this.at.scale = scale;
    this.redraw();
  }

  redraw() {
    if (this.due || !this.view) return;
    this.due = true;
    requestAnimationFrame(() => {
      this.due = false;
      if (!this.at) this.fit();
      const pen = this.pen;
      const ratio = window.devicePixelRatio || 1;
      pen.setTransform(1, 0, 0, 1, 0, 0);
      pen.clearRect(0, 0, this.canvas.width, this.canvas.height);
      if (!this.at) return;
      const { scale, x, y } = this.at;
      pen.setTransform(ratio * scale, 0, 0, ratio * scale, ratio * x, ratio * y);
      const { clientWidth: w, clientHeight: h } = this.canvas;
      this.view.draw(pen, scale, [-x / scale, -y / scale, (w - x) / scale, (h - y) / scale]);
    });
  }

  down(e) {
    this.canvas.setPointerCapture(e.pointerId);
    this.pointers.set(e.pointerId, { x: e.offsetX, y: e.offsetY, moved: 0 });
  }

  move(e) {
    const known = this.pointers.get(e.pointerId);
    if (!known || !this.at) return;
    const [dx, dy] = [e.offsetX - known.x, e.offsetY - known.y];
    known.moved += Math.hypot(dx, dy);
    if (this.pointers.size === 2) {
      const other = [...this.pointers.values()].find((p) => p !== known);
      other.moved += Math.hypot(dx, dy);
      const before = Math.hypot(known.x - other.x, known.y - other.y);
      const after = Math.hypot(e.offsetX - other.x, e.offsetY - other.y);
      if (before > 0) this.zoom(after / before, other.x, other.y);
    } else if (known.moved >= 5) {
      this.moved = true;
      this.at.x += dx;
      this.at.y += dy;
    }
    [known.x, known.y] = [e.offsetX, e.offsetY];
    this.redraw();
  }

  up(e) {
    const known = this.pointers.get(e.pointerId);
    this.pointers.delete(e.pointerId);
    if (e.type === 'pointerup' && known && known.moved < 5 && this.at) {
      const { scale, x, y } = this.at;
      this.choose(this.view.pick((e.offsetX - x) / scale, (e.offsetY - y) / scale, scale));
    }
  }

  key(e) {
    const { clientWidth: w, clientHeight: h } = this.canvas;
    const moves = { ArrowLeft: [60, 0], ArrowRight: [-60, 0], ArrowUp: [0, 60], ArrowDown: [0, -60] };
    if (moves[e.key] && this.at) {
      this.moved = true;
      this.at.x += moves[e.key][0];
      this.at.y += moves[e.key][1];
    } else if (e.key === '+' || e.key === '=') this.zoom(1.25, w / 2, h / 2);
    else if (e.key === '-') this.zoom(0.8, w / 2, h / 2);
    else if (e.key === '0') this.fit();
    else return;
    e.preventDefault();
    this.redraw();
  }
}

// Names in a drawing, as many as do not lie upon each other: those that come first stay.
export class Names {
  constructor(pen, size) {
    [this.pen, this.size, this.taken] = [pen, size, new Map()];
    pen.font = `${size}px system-ui, sans-serif`;
    pen.textAlign = 'center';
  }

  put(text, x, y, of, always = false) {
    const side = this.size * 8;
    const half = this.pen.measureText(text).width / 2;
    const box = [x - half, y - this.size, x + half, y + this.size / 4];
    const cells = [];
    for (let i = Math.floor(box[0] / side); i <= Math.floor(box[2] / side); i++) {
      for (let j = Math.floor(box[1] / side); j <= Math.floor(box[3] / side); j++) cells.push(`${i} ${j}`);
    }
    const meets = (b) => b[0] < box[2] && box[0] < b[2] && b[1] < box[3] && box[1] < b[3];
    if (!always && cells.some((cell) => this.taken.get(cell)?.some(meets))) return;
    for (const cell of cells) {
      if (!this.taken.has(cell)) this.taken.set(cell, []);
      this.taken.get(cell).push(box);
    }
    this.pen.fillStyle = of;
    this.pen.fillText(text, x, y);
  }
}

// A colour for a word, the same each time.
export function colour(word) {
  let hash = 2166136261;
  for (const c of word) hash = Math.imul(hash ^ c.codePointAt(0), 16777619);
  return `hsl(${(hash >>> 0) % 360} ${45 + ((hash >>> 9) % 35)}% ${36 + ((hash >>> 16) % 26)}%)`;
}

const inks = new Map();

// A colour of the style sheet, as long as light stays light and dark stays dark.
export function ink(name) {
  if (!inks.has(name)) inks.set(name, getComputedStyle(document.documentElement).getPropertyValue(name).trim());
  return inks.get(name);
}
