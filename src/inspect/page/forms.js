// What somebody may change, where that was allowed. Each form says beside itself what came of it: nothing is
// lost of what was entered when it is refused.

import { button, element } from './element.js';

// A form of labelled fields; `send` gets their values and says what was done.
export function form(title, fields, word, send) {
  const made = element('form');
  if (title) made.append(element('h2', title));
  const inputs = {};
  for (const { name, label, kind = 'input', wide, value, ...rest } of fields) {
    const input = element(kind, null, rest);
    if (value !== undefined) { if (rest.type === 'checkbox') input.checked = value; else input.value = value; }
    const place = element('label', null, wide ? { class: 'wide' } : rest.type === 'checkbox' ? { class: 'check' } : {});
    if (rest.type === 'checkbox') place.append(input, label); else place.append(label, input);
    inputs[name] = input;
    made.append(place);
  }
  const said = element('div', null, { class: 'said', 'aria-live': 'assertive' });
  const submit = element('button', word);
  made.append(submit, said);
  made.onsubmit = async (e) => {
    e.preventDefault();
    submit.disabled = true;
    try {
      const values = Object.fromEntries(Object.entries(inputs).map(([name, input]) => [name, input.type === 'checkbox' ? input.checked : input.value]));
      said.replaceChildren(element('p', await send(values), { class: 'good' }));
    } catch (error) {
      // A report underlines the place in what was entered.
      const whole = error.report?.includes('\u256d') ? element('pre', error.report) : element('p', error.message);
      whole.classList.add('bad');
      said.replaceChildren(whole);
    }
    submit.disabled = false;
  };
  return Object.assign(made, { inputs });
}

const done = ({ version }) => `Done: version ${version}.`;

export function setForm(node, edit) {
  const names = element('datalist', null, { id: 'attributes' });
  names.append(...node.attributes.map((one) => element('option', null, { value: one.name })));
  const made = form(`Set an attribute of ${node.name}`, [
    { name: 'name', label: 'Attribute', required: '', list: 'attributes', autocomplete: 'off' },
    { name: 'value', label: 'Value', required: '', autocomplete: 'off' },
  ], 'Set', async ({ name, value }) => done(await edit({ kind: 'set', path: `${node.name}.${name}`, value })));
  made.append(names);
  return made;
}

export function missionForm(edit) {
  return form('Submit a mission', [
    { name: 'name', label: 'Name of the mission', required: '', autocomplete: 'off' },
    { name: 'priority', label: 'Priority', type: 'number', step: '1', value: '0', required: '' },
    { name: 'goal', label: 'Goal in AGGL: what shall hold', kind: 'textarea', required: '', rows: '4', wide: true, spellcheck: 'false', placeholder: '{\n\t"robot":robot\n\tp:person\n\t"robot"->p(is_near)\n}' },
  ], 'Submit', async ({ name, priority, goal }) => {
    const { version } = await edit({ kind: 'mission', name, goal, priority: Number(priority) });
    return `Submitted with version ${version}: the executive plans for it above.`;
  });
}

// A field for each variable of the rule that is chosen.
export function ruleForm(rules, edit) {
  const place = element('div');
  const show = (rule) => {
    const fields = rule.variables.map(([variable, type]) => ({ name: variable, label: `${variable}: ${type}`, list: 'names', required: '', autocomplete: 'off' }));
    const made = form('Apply a rule', fields, `Apply ${rule.name}`, async (binding) => done(await edit({ kind: 'rule', rule: rule.name, binding })));
    const choice = element('select');
    choice.append(...rules.map(({ name }) => element('option', name)));
    choice.value = rule.name;
    choice.onchange = () => { show(rules.find(({ name }) => name === choice.value)); place.querySelector('select').focus(); };
    const label = element('label', 'Rule', { class: 'wide' });
    label.append(choice);
    made.querySelector('h2').after(label, element('p', `${rule.says} No agent carries it out: the graph changes as the rule says.`, { class: 'said soft' }));
    place.replaceChildren(made);
  };
  if (rules.length) show(rules[0]); else place.append(element('h2', 'Apply a rule'), element('p', 'The graph has no rules.'));
  return place;
}

const hour = (seconds) => new Date(seconds * 1000).toISOString().slice(11, 16);
const at = (day, text) => Math.floor(day / 86400) * 86400 + Number(text.slice(0, 2)) * 3600 + Number(text.slice(3, 5)) * 60;

// Changes when an activity takes place; hours of the days on which it begins and ends.
export function activityForm(activity, edit, leave) {
  const made = form(`Change ${activity.name}`, [
    { name: 'start', label: 'From', type: 'time', required: '', value: hour(activity.start) },
    { name: 'end', label: 'To', type: 'time', required: '', value: hour(activity.end) },
    { name: 'cancelled', label: 'cancelled', type: 'checkbox', value: activity.cancelled },
  ], 'Change', async ({ start, end, cancelled }) => done(await edit({
    kind: 'activity', name: activity.name, start: at(activity.start, start), end: at(activity.end, end), cancelled,
  })));
  made.querySelector('button').after(button('Close', leave));
  return made;
}
