// Missions, what is to take place when, and processes: as text, for everybody to read.

import { usageColour } from './map.js';

export function element(tag, text, attributes = {}) {
  const made = document.createElement(tag);
  if (text !== undefined && text !== null) made.textContent = text;
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  return made;
}

export function table(headings, rows) {
  const made = element('table');
  const head = made.createTHead().insertRow();
  for (const heading of headings) head.append(element('th', heading, { scope: 'col' }));
  const body = made.createTBody();
  for (const row of rows) {
    const line = body.insertRow();
    for (const cell of row) {
      const place = line.insertCell();
      if (typeof cell === 'number') { place.className = 'number'; place.textContent = String(cell); } else place.append(cell ?? '');
    }
  }
  return made;
}

const binding = (step) => Object.entries(step.binding).map(([variable, node]) => `${variable}=${node}`).join(', ');

export function missions(place, list, agenda, map, now, { why, ask }) {
  place.replaceChildren();
  if (!list.length) place.append(element('p', 'There are no missions.'));
  for (const mission of list) {
    const title = element('h2', `${mission.name}: ${mission.status}`);
    const buttons = [element('button', 'why')];
    buttons[0].onclick = () => why(mission.name);
    if (ask) {
      for (const request of ['pause', 'resume', 'cancel']) {
        const button = element('button', request);
        button.onclick = () => ask({ kind: 'request', mission: mission.name, request });
        buttons.push(button);
      }
    }
    title.append(' ', ...buttons);
    place.append(title);
    const facts = [mission.reason, `priority ${mission.priority}`, `replanned ${mission.replans} times`];
    place.append(element('p', facts.filter(Boolean).join('; '), { class: 'soft' }));
    const steps = element('ol', null, { class: 'steps', 'aria-label': `Plan of ${mission.name}` });
    for (const step of mission.steps) {
      const line = element('li', null, { class: step.status });
      line.append(element('span', step.rule, { class: 'rule' }), `(${binding(step)}) by ${step.agent}: `, element('b', step.status));
      if (step.reason) line.append(element('span', ` ${step.reason}`, { class: 'soft' }));
      const button = element('button', 'why');
      button.onclick = () => why(step.name);
      line.append(' ', button);
      steps.append(line);
    }
    place.append(steps);
    const decisions = element('ul');
    for (const { time, what, why: reason, cause } of mission.decisions) {
      const since = cause ? `, since version ${cause.version} by ${cause.agent} ${cause.rules.join(', ')}` : '';
      decisions.append(element('li', `${clock(time)} ${what}${reason ? `: ${reason}` : ''}${since}`));
    }
    if (mission.decisions.length) place.append(element('h3', 'What was decided'), decisions);
  }
  if (agenda?.length) place.append(element('h2', 'What takes place when'), agendaTable(agenda, map, now));
}

function agendaTable(agenda, map, now) {
  const usage = new Map((map?.objects ?? []).map((object) => [object.name, object.usage]));
  return table(['activity', 'at', 'from', 'to', '', 'R(t)'], agenda.map((row) => {
    const state = row.cancelled ? 'cancelled' : now < row.start ? `in ${minutes(row.start - now)}` : now > row.end ? 'over' : 'now';
    const cell = element('span', usage.get(row.object)?.toFixed(2) ?? '');
    cell.style.color = usageColour(usage.get(row.object));
    return [row.name, row.object ?? '', clock(row.start), clock(row.end), state, cell];
  }));
}

const minutes = (seconds) => `${Math.max(1, Math.round(seconds / 60))} min`;

export function clock(seconds) {
  if (seconds === null || seconds === undefined) return '';
  return new Date(seconds * 1000).toISOString().slice(11, 21);
}

export function agents(place, processes, rates) {
  place.replaceChildren(element('h2', 'Processes'));
  if (!processes) { place.append(element('p', 'A recording has no processes.')); return; }
  place.append(table(['name', 'state', 'restarts', 'load / %', 'memory / MB', 'commits / s', 'last commit', 'process'], processes.map((one) => {
    const rate = rates.get(one.name);
    return [one.name, one.state, one.restarts, one.load === null ? '' : Math.round(1000 * one.load) / 10,
      Math.round(one.memory / 1e5) / 10, rate ? Math.round(10 * rate.rate) / 10 : 0, rate ? clock(rate.time) : '', one.id];
  })));
}
