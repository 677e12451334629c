// The map: walls, rooms, the social grid, people with their zones, groups, objects with their spaces
// coloured by R(t) and the places where they may be, cameras, the robot with its path, band and laser.
// Metres; y goes up.

import { ink, Names } from './canvas.js';

const ZONES = ['#d32f2f', '#ef8f1a', '#c9b60a'];
const ROBOT = '#1f9d55';
const LASER = '#c2185b';

// What can be left out, with the colour that it has.
export const LAYERS = [
  ['costs', '#e6501e'], ['zones', ZONES[1]], ['groups', '#7b3fbf'], ['object spaces', '#a33b2a'], ['places of objects', '#8a7560'],
  ['cameras', '#3f7fa6'], ['laser', LASER], ['planned path', '#0b6b3a'], ['band', ROBOT],
];

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
    this.laser = null;
    this.usage = null; // R(t) by object at another time than now
    this.ids = new Map();
    this.hidden = new Set();
    this.selected = null;
  }

  set(map) { this.map = map; this.board.redraw(); }

  shows(layer) { return !this.hidden.has(layer); }

  setLaser(laser) { this.laser = laser; this.board.redraw(); }

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
    if (this.grid && this.shows('costs')) {
      const { place: [x, y, side], rows, columns, picture } = this.grid;
      pen.imageSmoothingEnabled = false;
      pen.drawImage(picture, x, y, columns * side, rows * side);
    }
    this.names = [];
    pen.setLineDash([]);
    for (const room of map.rooms) this.ring(pen, room.outline, ink('--line'), px);
    if (this.shows('cameras')) for (const camera of map.cameras) this.camera(pen, camera, px);
    pen.beginPath();
    for (const [a, b, c, d] of map.walls) { pen.moveTo(a, b); pen.lineTo(c, d); }
    pen.lineWidth = 0.08;
    pen.strokeStyle = ink('--ink');
    pen.stroke();
    for (const object of map.objects) this.object(pen, object, px);
    if (this.shows('groups')) for (const group of map.groups) this.ring(pen, group.outline, '#7b3fbf', 2 * px);
    if (this.laser && this.shows('laser')) this.scan(pen, this.laser, px);
    for (const person of map.people) this.person(pen, person, px);
    for (const robot of map.robots) this.robot(pen, robot, px);
    if (this.shows('places of objects')) for (const object of map.objects) this.places(pen, object, px);
    for (const room of map.rooms) {
      const n = room.outline.length || 1;
      const middle = room.outline.reduce(([a, b], [x, y]) => [a + x / n, b + y / n], [0, 0]);
      this.names.push([room.name, middle, ink('--soft')]);
    }
    pen.restore();
    const names = new Names(pen, 12 * px);
    for (const [name, [x, y], of] of this.names) names.put(name, x, -y - 0.32, of);
  }

  ring(pen, outline, of, width, fill, share = 0.18) {
    if (outline.length < 2) return;
    pen.beginPath();
    outline.forEach(([x, y], i) => (i ? pen.lineTo(x, y) : pen.moveTo(x, y)));
    pen.closePath();
    if (fill) { pen.fillStyle = fill; pen.globalAlpha = share; pen.fill(); pen.globalAlpha = 1; }
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
    this.mark(pen, thing, radius + 0.1, px);
    this.names.push([thing.name, [x, y + radius - 0.2], ink('--ink')]);
  }

  mark(pen, thing, radius, px) {
    if (this.selected === null || this.ids.get(thing.name) !== this.selected) return;
    pen.beginPath();
    pen.arc(thing.place[0], thing.place[1], radius, 0, 7);
    pen.lineWidth = 3 * px;
    pen.strokeStyle = ink('--mark');
    pen.stroke();
  }

  person(pen, person, px) {
    if (this.shows('zones')) person.zones.forEach((zone, i) => this.ring(pen, zone, ZONES[i], 1.5 * px, i === 0 ? ZONES[0] : null));
    this.standing(pen, person, person.radius, '#3b6fd1', px);
  }

  robot(pen, robot, px) {
    if (robot.planned.length && this.shows('planned path')) {
      pen.setLineDash([6 * px, 5 * px]);
      this.line(pen, robot.planned, '#0b6b3a', 1.5 * px);
      pen.setLineDash([]);
    }
    if (robot.path.length && this.shows('band')) {
      pen.globalAlpha = 0.5;
      robot.path.forEach(([x, y], i) => {
        pen.beginPath();
        pen.arc(x, y, robot.bubbles[i] ?? 0, 0, 7);
        pen.lineWidth = px;
        pen.strokeStyle = ROBOT;
        pen.stroke();
      });
      pen.globalAlpha = 1;
      this.line(pen, [robot.place, ...robot.path], ROBOT, 3 * px);
    }
    this.standing(pen, robot, robot.radius, ROBOT, px);
  }

  line(pen, points, of, width) {
    pen.beginPath();
    points.forEach(([x, y], i) => (i ? pen.lineTo(x, y) : pen.moveTo(x, y)));
    pen.lineWidth = width;
    pen.strokeStyle = of;
    pen.stroke();
  }

  // What the laser sees free, and where its beams met something.
  scan(pen, { from, ends, free }, px) {
    pen.beginPath();
    pen.moveTo(...from);
    for (const [x, y] of ends) pen.lineTo(x, y);
    pen.closePath();
    pen.globalAlpha = 0.06;
    pen.fillStyle = LASER;
    pen.fill();
    pen.globalAlpha = 1;
    const missed = new Set(free);
    ends.forEach(([x, y], i) => { if (!missed.has(i)) pen.fillRect(x - 1.5 * px, y - 1.5 * px, 3 * px, 3 * px); });
  }

  object(pen, object, px) {
    const then = this.usage?.get(object.name);
    const usage = then ?? object.usage;
    if (this.shows('object spaces')) this.ring(pen, object.space, usageColour(usage), 1.5 * px, usageColour(usage));
    this.footprint(pen, object, object.place, 1);
    this.mark(pen, object, Math.hypot(...object.size) / 2 + 0.05, px);
    const cost = then === undefined ? '' : ` R ${then.toFixed(2)}`;
    if (cost || px < 1 / 45) this.names.push([object.name + cost, object.place, ink('--soft')]);
  }

  footprint(pen, object, [x, y, heading], share) {
    pen.save();
    pen.translate(x, y);
    pen.rotate(heading);
    pen.globalAlpha = share;
    pen.fillStyle = '#8a7560';
    const [w, h] = object.size;
    if (object.circle) { pen.beginPath(); pen.arc(0, 0, w / 2, 0, 7); pen.fill(); } else pen.fillRect(-w / 2, -h / 2, w, h);
    pen.restore();
  }

  // Where an object may be instead: the likelier the fuller.
  places(pen, object, px) {
    if (object.places.length < 2) return;
    for (const [x, y, heading, probability] of object.places) {
      if (Math.hypot(x - object.place[0], y - object.place[1]) > 0.1) this.footprint(pen, object, [x, y, heading], 0.2 + 0.6 * probability);
      pen.setLineDash([3 * px, 3 * px]);
      this.ring(pen, [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([a, b]) => [x + a * 0.2, y + b * 0.2]), '#8a7560', px);
      pen.setLineDash([]);
      this.names.push([`${object.name} ${Math.round(100 * probability)} %`, [x, y - 0.55], ink('--ink')]);
    }
  }

  camera(pen, camera, px) {
    this.ring(pen, camera.view, '#3f7fa666', px, '#3f7fa6', 0.06);
    const [x, y] = camera.place;
    pen.fillStyle = '#3f7fa6';
    pen.fillRect(x - 4 * px, y - 4 * px, 8 * px, 8 * px);
    this.mark(pen, camera, 0.2, px);
    if (px < 1 / 60) this.names.push([camera.name, [x, y], ink('--soft')]);
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
