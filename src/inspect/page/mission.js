// Missions, what is to take place when, and processes: as text, for everybody to read.

import { ago, button, clock, element, renew, table } from './element.js';
import { activityForm } from './forms.js';
import { usageColour } from './map.js';

const binding = (step) => Object.entries(step.binding).map(([variable, node]) => `${variable}=${node}`).join(', ');

// `page` says why something is, goes to a time, and changes something where that is allowed.
export function missions(place, list, agenda, map, now, page) {
  const parts = [];
  if (!list.length) parts.push(element('p', 'There are no missions.'));
  for (const mission of list) parts.push(...missionParts(mission, page));
  if (agenda?.activities.length) parts.push(element('h2', 'What takes place when'), agendaTable(agenda, map, now, page));
  renew(place, ...parts);
}

function missionParts(mission, page) {
  const title = element('h2', `${mission.name}: ${mission.status}`);
  title.append(' ', whyButton(mission.name, page));
  const said = element('span', null, { role: 'status', class: 'bad' });
  if (page.edit) {
    for (const request of ['pause', 'resume', 'cancel']) {
      const ask = () => page.edit({ kind: 'request', mission: mission.name, request }).catch((error) => { said.textContent = ` ${error.message}`; });
      title.append(' ', button(request, ask, { label: `${request} ${mission.name}` }));
    }
  }
  title.append(said);
  const facts = [mission.reason, `priority ${mission.priority}`, `replanned ${mission.replans} times`, mission.deadline && `to be done by ${clock(mission.deadline)}`];
  const steps = element('ol', null, { class: 'steps', 'aria-label': `Plan of ${mission.name}` });
  for (const step of mission.steps) {
    const line = element('li', null, { class: step.status });
    if (['running', 'dispatched'].includes(step.status)) line.setAttribute('aria-current', 'step');
    line.append(element('span', step.rule, { class: 'rule' }), `(${binding(step)}) by ${step.agent}: `, element('b', step.status));
    const since = step.status === 'pending' ? '' : ` since ${clock(step.since)}`;
    line.append(element('span', `${since}${step.reason ? `: ${step.reason}` : ''} `, { class: 'soft' }), whyButton(step.name, page));
    steps.append(line);
  }
  const parts = [title, element('p', facts.filter(Boolean).join('; '), { class: 'soft' }), steps];
  if (mission.decisions.length) {
    const decisions = element('ol', null, { 'aria-label': `What was decided about ${mission.name}` });
    for (const { time, what, why, cause } of mission.decisions) {
      const line = element('li', `${clock(time)} ${what}${why ? `: ${why}` : ''}`);
      if (cause) {
        line.append(', since ', button(`version ${cause.version}`, () => page.goTo(cause.time), { link: true, key: `${mission.name} ${time} ${cause.version}`, title: 'Go there' }));
        line.append(` by ${cause.agent} `, element('span', cause.rules.join(', '), { class: 'rule' }));
      }
      decisions.append(line);
    }
    parts.push(element('h3', 'What was decided'), decisions);
  }
  const goal = element('details');
  goal.append(element('summary', 'Goal'), element('pre', mission.goal));
  parts.push(goal);
  return parts;
}

const whyButton = (path, page) => button('why', () => page.why(path), { label: `Why ${path}` });

function agendaTable(agenda, map, now, page) {
  const usage = new Map((map?.objects ?? []).map((object) => [object.name, object.usage]));
  const place = element('div');
  const rows = agenda.activities.map((row) => {
    const state = row.cancelled ? 'cancelled' : now < row.start ? `in ${ago(row.start - now)}` : now > row.end ? 'over' : 'now';
    const cells = element('span', null, { class: 'tight' });
    for (const object of row.objects) {
      const swatch = element('span', null, { class: 'swatch' });
      swatch.style.background = usageColour(usage.get(object));
      cells.append(swatch, ` ${object} ${usage.get(object)?.toFixed(2) ?? 'not seen'} `);
    }
    const buttons = element('span');
    buttons.append(whyButton(row.name, page));
    if (page.edit) buttons.append(' ', button('change', () => { page.changes(row); }, { label: `Change ${row.name}` }));
    return [row.name, cells, clock(row.start).slice(0, 8), clock(row.end).slice(0, 8), state, buttons];
  });
  place.append(table(['activity', 'at, with R(t)', 'from', 'to', '', ''], rows, 'Agenda'));
  return place;
}

// The form that changes an activity, in its place beside the other forms.
export function changeActivity(place, activity, edit) {
  const leave = () => { place.replaceChildren(); document.querySelector(`[data-key="Change ${CSS.escape(activity.name)}"]`)?.focus(); };
  place.replaceChildren(activityForm(activity, edit, leave));
  place.querySelector('input').focus();
}

export function agents(place, processes, now) {
  const parts = [element('h2', 'Processes')];
  if (!processes) parts.push(element('p', 'A recording has no processes.'));
  else {
    parts.push(table(['name', 'state', 'restarts', 'load / %', 'memory / MB', 'commits / s', 'last commit', 'process'], processes.map((one) => {
      const tenths = (number) => (number === null ? '' : number.toFixed(1));
      const cells = [tenths(one.load && 100 * one.load), tenths(one.memory / 1e6), tenths(one.commits)].map((text) => element('span', text, { class: 'number' }));
      return [one.name, one.state, one.restarts, ...cells, one.last === null ? '' : `${ago(Math.max(0, now - one.last))} ago`, one.id];
    }), 'Processes'));
  }
  renew(place, ...parts);
}
