// The map: walls, rooms, the social grid, people with their zones, groups, objects with their spaces
// coloured by R(t), the robot, its path. Metres; y goes up.

import { ink } from './canvas.js';

const ZONES = ['#d32f2f', '#ef8f1a', '#c9b60a'];

// Green where crossing costs what free space costs, red from 3.5.
export function usageColour(usage) {
  const hot = Math.min(Math.max(((usage ?? 1) - 1) / 2.5, 0), 1);
  return `hsl(${120 - 120 * hot} 65% 42%)`;
}

export class MapView {
  constructor(board) {
    this.board = board;
    this.map = null;
    this.grid = null;
    this.ids = new Map();
    this.selected = null;
  }

  set(map) { this.map = map; this.board.redraw(); }

  // The social grid as a picture: the more it costs the redder, and grey where nothing may enter.
  setGrid(grid) {
    if (!grid) { this.grid = null; return; }
    const picture = document.createElement('canvas');
    [picture.width, picture.height] = [grid.columns, grid.rows];
    const pen = picture.getContext('2d');
    const data = pen.createImageData(grid.columns, grid.rows);
    const cells = atob(grid.cells);
    for (let i = 0; i < cells.length; i++) {
      const cost = cells.charCodeAt(i);
      const blocked = cost === 255;
      data.data.set(blocked ? [120, 125, 130, 70] : [230, 80, 30, Math.min(cost * 3, 190)], 4 * i);
    }
    pen.putImageData(data, 0, 0);
    this.grid = { picture, ...grid };
    this.board.redraw();
  }

  bounds() {
    const map = this.map;
    if (!map) return null;
    const xs = map.walls.flatMap(([a, , b]) => [a, b]);
    const ys = map.walls.flatMap(([, a, , b]) => [a, b]);
    if (map.bounds) { xs.push(map.bounds[0], map.bounds[2]); ys.push(map.bounds[1], map.bounds[3]); }
    for (const thing of [...map.people, ...map.robots, ...map.objects]) { xs.push(thing.place[0]); ys.push(thing.place[1]); }
    if (!xs.length) return [-5, -5, 5, 5];
    return [Math.min(...xs) - 0.5, -Math.max(...ys) - 0.5, Math.max(...xs) + 0.5, -Math.min(...ys) + 0.5];
  }

  draw(pen, scale) {
    const map = this.map;
    if (!map) return;
    pen.save();
    pen.scale(1, -1);
    const px = 1 / scale;
    if (this.grid) {
      const { place: [x, y, side], rows, columns, picture } = this.grid;
      pen.imageSmoothingEnabled = false;
      pen.drawImage(picture, x, y, columns * side, rows * side);
    }
    this.names = [];
    pen.setLineDash([]);
    for (const room of map.rooms) {
      this.ring(pen, room.outline, ink('--line'), px);
      const n = room.outline.length || 1;
      const middle = room.outline.reduce(([a, b], [x, y]) => [a + x / n, b + y / n], [0, 0]);
      this.names.push([room.name, middle, ink('--soft')]);
    }
    pen.beginPath();
    for (const [a, b, c, d] of map.walls) { pen.moveTo(a, b); pen.lineTo(c, d); }
    pen.lineWidth = 0.08;
    pen.strokeStyle = ink('--ink');
    pen.stroke();
    for (const camera of map.cameras) this.camera(pen, camera, px);
    for (const object of map.objects) this.object(pen, object, px);
    for (const group of map.groups) this.ring(pen, group.outline, '#7b3fbf', 2 * px);
    for (const person of map.people) this.person(pen, person, px);
    for (const robot of map.robots) this.robot(pen, robot, px);
    pen.restore();
    pen.font = `${12 * px}px system-ui, sans-serif`;
    pen.textAlign = 'center';
    for (const [name, [x, y], of] of this.names) { pen.fillStyle = of; pen.fillText(name, x, -y - 0.32); }
  }

  ring(pen, outline, of, width, fill) {
    if (outline.length < 2) return;
    pen.beginPath();
    outline.forEach(([x, y], i) => (i ? pen.lineTo(x, y) : pen.moveTo(x, y)));
    pen.closePath();
    if (fill) { pen.fillStyle = fill; pen.globalAlpha = 0.18; pen.fill(); pen.globalAlpha = 1; }
    pen.lineWidth = width;
    pen.strokeStyle = of;
    pen.stroke();
  }

  standing(pen, thing, radius, of, px) {
    const [x, y, heading] = thing.place;
    pen.beginPath();
    pen.arc(x, y, radius, 0, 7);
    pen.fillStyle = of;
    pen.fill();
    pen.beginPath();
    pen.moveTo(x, y);
    pen.lineTo(x + 1.6 * radius * Math.cos(heading), y + 1.6 * radius * Math.sin(heading));
    pen.lineWidth = 2 * px;
    pen.strokeStyle = ink('--ink');
    pen.stroke();
    if (this.ids.get(thing.name) === this.selected) {
      pen.beginPath();
      pen.arc(x, y, radius + 0.1, 0, 7);
      pen.lineWidth = 3 * px;
      pen.strokeStyle = ink('--mark');
      pen.stroke();
    }
    this.names.push([thing.name, [x, y + radius - 0.2], ink('--ink')]);
  }

  person(pen, person, px) {
    person.zones.forEach((zone, i) => this.ring(pen, zone, ZONES[i], 1.5 * px, i === 0 ? ZONES[0] : null));
    this.standing(pen, person, person.radius, '#3b6fd1', px);
  }

  robot(pen, robot, px) {
    if (robot.path.length) {
      pen.beginPath();
      pen.moveTo(robot.place[0], robot.place[1]);
      for (const [x, y] of robot.path) pen.lineTo(x, y);
      pen.lineWidth = 3 * px;
      pen.strokeStyle = '#1f9d55';
      pen.stroke();
    }
    this.standing(pen, robot, robot.radius, '#1f9d55', px);
  }

  object(pen, object, px) {
    const of = usageColour(object.usage);
    this.ring(pen, object.space, of, 1.5 * px, of);
    const [x, y, heading] = object.place;
    pen.save();
    pen.translate(x, y);
    pen.rotate(heading);
    pen.fillStyle = '#8a7560';
    const [w, h] = object.size;
    if (object.circle) { pen.beginPath(); pen.arc(0, 0, w / 2, 0, 7); pen.fill(); } else pen.fillRect(-w / 2, -h / 2, w, h);
    pen.restore();
    if (px < 1 / 45) this.names.push([object.name, [x, y], ink('--soft')]);
  }

  camera(pen, camera, px) {
    const [x, y, heading] = camera.place;
    const [angle, range] = camera.sees ?? [1, 0.5];
    pen.beginPath();
    pen.moveTo(x, y);
    pen.arc(x, y, Math.min(range, 1.2), heading - angle / 2, heading + angle / 2);
    pen.closePath();
    pen.lineWidth = px;
    pen.strokeStyle = ink('--soft');
    pen.stroke();
  }

  pick(x, y) {
    const map = this.map;
    if (!map) return null;
    let [best, least] = [null, 0.6];
    for (const thing of [...map.people, ...map.robots, ...map.objects, ...map.groups, ...map.cameras]) {
      const far = Math.hypot(thing.place[0] - x, thing.place[1] + y);
      if (far < least) [best, least] = [thing.name, far];
    }
    return best === null ? null : (this.ids.get(best) ?? null);
  }

  describe() {
    if (!this.map) return 'The map';
    const names = (list) => list.map((one) => one.name).join(', ') || 'none';
    return `The map. People: ${names(this.map.people)}. Groups: ${names(this.map.groups)}. Robots: ${names(this.map.robots)}.`;
  }
}
