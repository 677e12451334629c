// The graph: nodes in clusters by type and room, where the program put them; edges; what just changed
// lights up and fades.

import { colour, ink, Names } from './canvas.js';

const FADE = 900; // ms

export class GraphView {
  constructor(board) {
    this.board = board;
    this.nodes = new Map();
    this.edges = [];
    this.types = [];
    this.labels = [];
    this.hidden = new Set();
    this.lit = new Map();
    this.selected = null;
    this.matches = new Set();
    this.picture = document.createElement('canvas');
    this.revision = 0;
  }

  set(graph) {
    this.revision += 1;
    this.types = graph.types;
    this.labels = graph.labels;
    this.nodes = new Map(graph.nodes.map(([id, name, type, x, y]) => [id, { id, name, type: graph.types[type], x, y }]));
    this.edges = graph.edges.map(([from, label, to]) => [this.nodes.get(from), graph.labels[label], this.nodes.get(to)]);
    this.board.redraw();
  }

  light(ids) {
    const now = performance.now();
    for (const id of ids) this.lit.set(id, now);
    this.board.redraw();
  }

  bounds() {
    let box = null;
    for (const { x, y } of this.nodes.values()) {
      box = box ? [Math.min(box[0], x), Math.min(box[1], y), Math.max(box[2], x), Math.max(box[3], y)] : [x, y, x, y];
    }
    return box && [box[0] - 40, box[1] - 40, box[2] + 40, box[3] + 40];
  }

  shown(node) { return node && !this.hidden.has(node.type); }

  // What stands still is drawn once and kept as a picture: what lights up fades upon it.
  draw(pen, scale, box) {
    const { width, height } = pen.canvas;
    const key = [scale, ...box, width, height, this.selected, this.revision, ...this.hidden, ink('--ink')].join(' ');
    if (key !== this.key) {
      this.key = key;
      [this.picture.width, this.picture.height] = [width, height];
      const still = this.picture.getContext('2d');
      still.setTransform(pen.getTransform());
      this.drawStill(still, scale, box);
    }
    pen.save();
    pen.resetTransform();
    pen.drawImage(this.picture, 0, 0);
    pen.restore();
    this.drawLit(pen, scale, Math.max(6, 2.5 / scale));
  }

  drawStill(pen, scale, [x0, y0, x1, y1]) {
    const inside = (n) => n.x > x0 - 60 && n.x < x1 + 60 && n.y > y0 - 60 && n.y < y1 + 60;
    pen.lineWidth = 1 / scale;
    // One path for all that look the same: thousands of edges in one stroke.
    for (const chosen of [false, true]) {
      pen.beginPath();
      for (const [a, , b] of this.edges) {
        if (!this.shown(a) || !this.shown(b) || (!inside(a) && !inside(b))) continue;
        const touches = a.id === this.selected || b.id === this.selected;
        if (touches !== chosen) continue;
        pen.moveTo(a.x, a.y);
        pen.lineTo(b.x, b.y);
      }
      pen.strokeStyle = chosen ? ink('--mark') : ink('--line');
      pen.stroke();
    }
    const byType = new Map();
    for (const node of this.nodes.values()) {
      if (!this.shown(node) || !inside(node)) continue;
      if (!byType.has(node.type)) byType.set(node.type, []);
      byType.get(node.type).push(node);
    }
    const r = Math.max(6, 2.5 / scale);
    for (const [type, nodes] of byType) {
      pen.beginPath();
      for (const { x, y } of nodes) { pen.moveTo(x + r, y); pen.arc(x, y, r, 0, 7); }
      pen.fillStyle = colour(type);
      pen.fill();
    }
    this.drawMatches(pen, scale, r);
    const chosen = this.nodes.get(this.selected);
    if (this.shown(chosen)) {
      pen.beginPath();
      pen.arc(chosen.x, chosen.y, r + 5, 0, 7);
      pen.lineWidth = 3 / Math.min(scale, 1);
      pen.strokeStyle = ink('--mark');
      pen.stroke();
    }
    this.drawNames(pen, scale, byType, r);
  }

  drawLit(pen, scale, r) {
    const now = performance.now();
    pen.lineWidth = 2 / Math.min(scale, 1);
    for (const [id, since] of this.lit) {
      const left = 1 - (now - since) / FADE;
      const node = this.nodes.get(id);
      if (left <= 0 || !this.shown(node)) { this.lit.delete(id); continue; }
      pen.beginPath();
      pen.arc(node.x, node.y, r + 4 * left, 0, 7);
      pen.strokeStyle = `hsl(40 95% 50% / ${left})`;
      pen.stroke();
    }
    if (this.lit.size) this.board.redraw();
  }

  drawMatches(pen, scale, r) {
    pen.beginPath();
    for (const id of this.matches) {
      const node = this.nodes.get(id);
      if (!this.shown(node)) continue;
      pen.moveTo(node.x + r + 3, node.y);
      pen.arc(node.x, node.y, r + 3, 0, 7);
    }
    pen.lineWidth = 2 / Math.min(scale, 1);
    pen.strokeStyle = ink('--bad');
    pen.stroke();
  }

  drawNames(pen, scale, byType, r) {
    const names = new Names(pen, 11 / Math.min(Math.max(scale, 0.4), 2));
    const put = (node, always) => names.put(node.name, node.x, node.y - r - 3, ink('--ink'), always);
    const chosen = this.nodes.get(this.selected);
    if (this.shown(chosen)) put(chosen, true);
    for (const id of this.matches) if (this.shown(this.nodes.get(id))) put(this.nodes.get(id));
    let count = 0;
    for (const nodes of byType.values()) count += nodes.length;
    // Names where they can be read.
    if (count > 600 || (count > 150 && scale < 0.75)) return;
    for (const nodes of byType.values()) for (const node of nodes) if (node !== chosen) put(node);
  }

  pick(x, y, scale) {
    let best = null;
    let least = Math.max(12, 14 / scale);
    for (const node of this.nodes.values()) {
      const far = Math.hypot(node.x - x, node.y - y);
      if (this.shown(node) && far < least) [best, least] = [node.id, far];
    }
    return best;
  }

  // The nodes whose name has a text in it, the one that is called so first; what is found is marked.
  search(text) {
    const part = text.trim().toLowerCase();
    const all = part ? [...this.nodes.values()].filter((node) => node.name.toLowerCase().includes(part)) : [];
    all.sort((a, b) => (b.name.toLowerCase() === part) - (a.name.toLowerCase() === part));
    this.revision += 1;
    this.matches = new Set(all.map((node) => node.id));
    this.board.redraw();
    return all;
  }

  describe() { return `The graph: ${this.nodes.size} nodes and ${this.edges.length} edges`; }
}
