// What happens: commits, newest first. While somebody points at the list or has the focus in it, it holds
// still, so that what is meant is what is clicked.

import { button, clock, element } from './element.js';

const KEPT = 80;
const EVERY = 250; // ms: nobody reads faster

export class Log {
  constructor({ list, ruled, author, held }, page) {
    Object.assign(this, { list, ruled, author, held, page, waiting: [], over: false, timer: null, known: new Set() });
    list.onpointerenter = (e) => { this.over = e.pointerType === 'mouse'; };
    list.onpointerleave = () => { this.over = false; this.flush(); };
    list.addEventListener('focusout', () => setTimeout(() => this.flush()));
    ruled.onchange = author.onchange = () => page.sifted();
  }

  get sifts() { return this.ruled.checked || this.author.value !== ''; }

  passes(commit) { return (!this.ruled.checked || commit.rules.length > 0) && (!this.author.value || commit.agent === this.author.value); }

  // Begins anew with these, newest first.
  set(commits) {
    this.waiting = [];
    this.list.replaceChildren();
    this.add([...commits].reverse());
    this.flush();
  }

  // Adds what came, oldest first.
  add(commits) {
    for (const { agent } of commits) {
      if (this.known.has(agent)) continue;
      this.known.add(agent);
      this.author.append(element('option', agent, { value: agent }));
    }
    this.waiting.push(...commits.filter((commit) => this.passes(commit)));
    this.waiting.splice(0, this.waiting.length - KEPT);
    this.timer ??= setTimeout(() => { this.timer = null; this.flush(); }, EVERY);
  }

  flush() {
    const holds = this.over || this.list.contains(document.activeElement);
    this.held.textContent = holds && this.waiting.length ? `held: ${this.waiting.length} more` : '';
    if (holds) return;
    this.list.prepend(...this.waiting.map((commit) => this.line(commit)).reverse());
    this.waiting = [];
    while (this.list.children.length > KEPT) this.list.lastChild.remove();
  }

  line(commit) {
    const line = element('li');
    const then = button(clock(commit.time), () => this.page.goTo(commit.time), { link: true, label: `Go to ${clock(commit.time)}, version ${commit.version}`, title: `version ${commit.version}: go there` });
    then.classList.add('soft');
    line.append(then, ' ', element('b', commit.agent), ' ');
    if (commit.rules.length) line.append(element('span', commit.rules.join(', '), { class: 'rule' }), ' ');
    commit.what.forEach((path, i) => line.append(i ? ', ' : '', button(path, () => this.page.why(path), { link: true, label: `Why ${path}` })));
    if (commit.more) line.append(`, and ${commit.more} more`);
    return line;
  }
}
