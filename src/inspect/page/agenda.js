// The agenda as a strip of hours: each object's R(t) as a colour, its activities upon it, a line for now. A
// slider below chooses another time, for which the map then has the spaces' colours.

import { ink } from './canvas.js';
import { clock, element } from './element.js';
import { usageColour } from './map.js';

export class Strip {
  constructor(place, pick) {
    [this.place, this.pick] = [place, pick];
    this.agenda = null;
    this.now = 0;
    this.rows = element('div');
    this.slider = element('input', null, { type: 'range', 'aria-label': 'R(t) at another time' });
    this.slider.oninput = () => this.choose(Number(this.slider.value));
    this.output = element('output');
    const line = element('div', null, { class: 'row' });
    this.release = element('button', 'as it is', { type: 'button', title: 'The spaces as they are now' });
    this.release.onclick = () => this.choose(null);
    const label = element('span');
    label.append(this.release);
    line.append(label, this.slider);
    place.append(this.rows, line, this.output);
    new ResizeObserver(() => this.draw()).observe(place);
    this.chosen = null;
  }

  set(agenda) {
    this.agenda = agenda;
    this.now = agenda.now;
    const names = new Set(agenda.activities.flatMap((one) => one.objects));
    this.objects = [...names].sort();
    [this.slider.min, this.slider.max, this.slider.step] = [agenda.from, agenda.to, agenda.step];
    this.rows.replaceChildren(...this.objects.map((name) => {
      const row = element('div', null, { class: 'row' });
      const canvas = element('canvas', null, { role: 'img', 'aria-label': this.describe(name) });
      row.append(element('span', name, { title: name }), canvas);
      return row;
    }));
    this.choose(this.chosen);
    this.draw();
  }

  describe(name) {
    const uses = this.agenda.activities.filter((one) => one.objects.includes(name));
    return `${name}: ${uses.map((one) => `${one.name} from ${clock(one.start)} to ${clock(one.end)}${one.cancelled ? ', cancelled' : ''}`).join('; ')}`;
  }

  tick(now) {
    if (Math.abs(now - this.now) < 5) return;
    this.now = now;
    if (this.chosen === null) this.slider.value = now;
    this.draw();
  }

  usageAt(time) {
    const { from, step, usage } = this.agenda;
    const index = Math.round((time - from) / step);
    return new Map(Object.entries(usage).map(([name, values]) => [name, values[Math.min(Math.max(index, 0), values.length - 1)]]));
  }

  choose(time) {
    this.chosen = time;
    const usage = time === null ? null : this.usageAt(time);
    this.slider.value = time ?? this.now;
    this.release.disabled = time === null;
    if (!this.objects.length) this.output.value = 'Nothing is on the agenda.';
    else if (!usage) this.output.value = 'The map shows R(t) as it is. Move the slider for another time.';
    else this.output.value = `At ${clock(time)}: ${this.objects.map((name) => `${name} ${usage.has(name) ? usage.get(name).toFixed(2) : 'was not seen'}`).join(', ')}`;
    this.slider.setAttribute('aria-valuetext', time === null ? 'as it is' : this.output.value);
    this.draw();
    this.pick(usage && new Map([...usage].filter(([name]) => this.objects.includes(name))));
  }

  draw() {
    if (!this.agenda) return;
    const ratio = window.devicePixelRatio || 1;
    [...this.rows.querySelectorAll('canvas')].forEach((canvas, i) => {
      const [w, h] = [canvas.clientWidth, canvas.clientHeight];
      if (!w || !h) return;
      [canvas.width, canvas.height] = [w * ratio, h * ratio];
      const pen = canvas.getContext('2d');
      pen.scale(ratio, ratio);
      this.row(pen, this.objects[i], w, h);
    });
  }

  row(pen, name, w, h) {
    const { from, to, step, usage, activities } = this.agenda;
    const x = (time) => (w * (time - from)) / (to - from);
    pen.globalAlpha = 0.45;
    (usage[name] ?? []).forEach((value, i) => {
      // From edge to edge on whole pixels, so that none is painted twice.
      const [left, right] = [Math.round(x(from + (i - 0.5) * step)), Math.round(x(from + (i + 0.5) * step))];
      pen.fillStyle = usageColour(value);
      pen.fillRect(left, 0, right - left, h);
    });
    pen.globalAlpha = 1;
    pen.font = '11px system-ui, sans-serif';
    pen.textBaseline = 'middle';
    for (const one of activities.filter((each) => each.objects.includes(name))) {
      pen.strokeStyle = pen.fillStyle = ink('--ink');
      pen.setLineDash(one.cancelled ? [3, 3] : []);
      pen.strokeRect(x(one.start) + 0.5, 2.5, Math.max(x(one.end) - x(one.start) - 1, 1), h - 5);
      pen.fillText(one.cancelled ? `${one.name} (cancelled)` : one.name, Math.max(x(one.start), 0) + 5, h / 2);
    }
    pen.setLineDash([]);
    pen.fillStyle = ink('--mark');
    pen.fillRect(x(this.now) - 1, 0, 2, h);
    if (this.chosen !== null) { pen.fillStyle = ink('--bad'); pen.fillRect(x(this.chosen) - 1, 0, 2, h); }
    pen.font = '10px system-ui, sans-serif';
    pen.fillStyle = ink('--ink');
    const hours = Math.max(1, Math.ceil((to - from) / 3600 / (w / 50)));
    for (let time = Math.ceil(from / 3600) * 3600; time < to; time += hours * 3600) pen.fillRect(x(time), h - 3, 1, 3);
  }
}
