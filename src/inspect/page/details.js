// What is chosen: a node with its attributes and edges, the history of one of them, or why something is.

import { ago, button, clock, element, renew, table } from './element.js';
import { setForm } from './forms.js';

export class Details {
  // `ask` asks the program as of the time that is looked at; `page` says what the page knows.
  constructor(place, ask, page) {
    [this.place, this.ask, this.page] = [place, ask, page];
    this.chosen = null;
    this.shows = null; // 'node', 'why' or 'history'
    this.turn = 0; // what was asked for last is what is shown, whichever answer comes last
    this.head = element('div');
    this.form = element('div');
  }

  async choose(id) {
    this.chosen = id;
    this.form.replaceChildren();
    if (id !== null) await this.node();
  }

  // Looks again, where that is not a text that somebody reads.
  async again() { if (this.shows === 'node' && this.chosen !== null) await this.node(); }

  failed(error) { renew(this.place, element('p', error.message, { class: 'bad', role: 'alert' }), this.back()); }

  back() { return button('back', () => (this.chosen === null ? this.place.replaceChildren() : this.node()), { label: 'Back to what is chosen' }); }

  async node() {
    const node = await this.answer('node', 'node', { id: this.chosen });
    if (!node) return;
    const title = element('h2', node.name);
    title.append(' ', element('span', node.type, { class: 'soft' }), ' ', this.why(node.name), ' ', this.past(node.name));
    const rows = node.attributes.map((one) => {
      const path = `${node.name}.${one.name}`;
      const buttons = element('span');
      buttons.append(this.past(path), ' ', this.why(path));
      const value = element('span', one.text.length > 160 ? `${one.text.slice(0, 160)} \u2026` : one.text, { title: one.text });
      value.append(element('br'), element('small', `${one.writer}, ${ago(one.age)} ago`, { class: 'soft' }));
      return [one.name, value, buttons];
    });
    const edges = node.edges.map((edge) => {
      const path = `${edge.from}-${edge.label}->${edge.to}`;
      const buttons = element('span');
      buttons.append(this.past(path), ' ', this.why(path));
      const said = edge.attributes.map((one) => `${one.name} ${one.text}, ${one.writer}, ${ago(one.age)} ago`).join('; ');
      return [this.other(edge.from, edge.from_id, path), element('span', edge.label, { title: said }), this.other(edge.to, edge.to_id, path), buttons];
    });
    if (this.page.mayEdit() && !this.form.firstChild) this.form.append(setForm(node, this.page.edit));
    if (!this.place.contains(this.head) || !this.place.contains(this.form)) this.place.replaceChildren(this.head, this.form);
    renew(this.head, title, table(['attribute', 'value, by whom, how old', ''], rows, `Attributes of ${node.name}`), element('h2', 'Edges'), table(['from', 'label', 'to', ''], edges, `Edges of ${node.name}`));
  }

  other(name, id, path) { return button(name, () => this.page.go(id), { key: `${path} ${name}`, link: true }); }

  why(path) { return button('why', () => this.showWhy(path), { label: `Why ${path}` }); }

  past(path) { return button('history', () => this.showHistory(path), { label: `History of ${path}` }); }

  // What the program says to a question; nothing where it refuses, which is shown, or where something else was
  // asked for meanwhile.
  async answer(shows, what, question) {
    this.shows = shows;
    this.turn += 1;
    const turn = this.turn;
    try {
      const told = await this.ask(what, question);
      return turn === this.turn ? told : null;
    } catch (error) {
      if (turn === this.turn) this.failed(error);
      return null;
    }
  }

  async showWhy(path) {
    const told = await this.answer('why', 'why', { path });
    if (!told) return;
    renew(this.place, element('h2', `Why ${path}`), element('pre', told.text, { tabindex: '0' }), this.back());
    this.place.parentElement.focus({ preventScroll: true });
    this.place.parentElement.scrollTop = 0;
  }

  async showHistory(path) {
    const told = await this.answer('history', 'history', { path });
    if (!told) return;
    const rows = told.entries.map((entry) => {
      const then = button(clock(entry.time), () => this.page.goTo(entry.time), { label: `Go to ${clock(entry.time)}`, link: true });
      return [then, entry.agent, (entry.rules ?? []).join(', '), entry.text ?? JSON.stringify(entry.value)];
    });
    renew(this.place, element('h2', `History of ${path}`), table(['time', 'by', 'rule', 'value'], rows, `History of ${path}`), this.back());
    this.place.parentElement.scrollTop = 0;
  }
}
