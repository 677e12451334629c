// The page: what is chosen, as of when, and in which view. Everything it knows it asks of the program
// that served it.

import { Board, colour } from './canvas.js';
import { GraphView } from './graph.js';
import { MapView } from './map.js';
import { agents, clock, element, missions, table } from './mission.js';

const $ = (id) => document.getElementById(id);
const state = { about: null, at: null, tab: 'graph', chosen: null, playing: null, missions: [], agenda: [], processes: null, rates: new Map(), gridOf: null };
const hash = new URLSearchParams(location.hash.slice(1));
const token = hash.get('token');
const still = hash.has('still'); // looks once and follows nothing: for pictures

async function ask(what, question = {}) {
  const query = new URLSearchParams(Object.entries(question).filter(([, value]) => value !== null && value !== undefined));
  const answer = await fetch(`/api/${what}?${query}`);
  const json = await answer.json();
  if (!answer.ok) throw new Error([json.error, json.help].filter(Boolean).join('; '));
  return json;
}

async function edit(change) {
  const answer = await fetch('/api/edit', { method: 'POST', headers: { 'x-cortex-token': token ?? '' }, body: JSON.stringify(change) });
  const json = await answer.json();
  say(answer.ok ? `done: version ${json.version}` : json.error, !answer.ok);
  if (answer.ok && state.chosen !== null) showNode(state.chosen);
}

const say = (text, bad = false) => { $('status').textContent = text; $('status').classList.toggle('bad', bad); };
const then = () => ({ at: state.at });
const mayEdit = () => state.about?.allow_edit && token;

const board = new Board($('canvas'), (id) => choose(id));
const graph = new GraphView(board);
const map = new MapView(board);

async function loadGraph() {
  const whole = await ask('graph', then());
  graph.set(whole);
  map.ids = new Map([...graph.nodes.values()].map((node) => [node.name, node.id]));
  const kinds = new Map();
  for (const node of graph.nodes.values()) kinds.set(node.type, (kinds.get(node.type) ?? 0) + 1);
  showFilters(kinds);
  $('names').replaceChildren(...[...graph.nodes.values()].slice(0, 2000).map(({ name }) => element('option', null, { value: name })));
  describe();
  requestAnimationFrame(() => { document.body.dataset.drawn ??= Math.round(performance.now()); });
}

function showFilters(kinds) {
  const boxes = [...kinds].sort().map(([type, count]) => {
    const label = element('label');
    const box = element('input', null, { type: 'checkbox' });
    box.checked = !graph.hidden.has(type);
    box.onchange = () => { graph.hidden[box.checked ? 'delete' : 'add'](type); board.redraw(); };
    const swatch = element('span', null, { class: 'swatch' });
    swatch.style.background = colour(type);
    label.append(box, swatch, `${type} ${count}`);
    return label;
  });
  $('filters').replaceChildren($('filters').querySelector('legend'), ...boxes);
}

async function loadRest() {
  const [place, list, agenda] = await Promise.all([ask('map', then()), ask('missions', then()), ask('agenda', then())]);
  map.set(place);
  [state.missions, state.agenda] = [list, agenda];
  if (state.at === null && state.tab === 'map') loadGrid(); else map.setGrid(null);
  if (state.at !== null) {
    $('log').replaceChildren();
    showCommits((await ask('commits', then())).reverse());
  }
  showText();
  describe();
}

async function loadGrid() {
  if (state.gridOf && performance.now() - state.gridOf < 1000) return;
  state.gridOf = performance.now();
  map.setGrid(await ask('grid').catch(() => null));
}

async function choose(id) {
  state.chosen = id;
  graph.selected = map.selected = id;
  board.redraw();
  if (id !== null) await showNode(id);
}

async function showNode(id) {
  try {
    const node = await ask('node', { id, ...then() });
    const place = $('selected');
    const title = element('h2', node.name);
    title.append(' ', element('span', node.type, { class: 'soft' }), ' ', whyButton(node.name));
    const rows = node.attributes.map((one) => {
      const path = `${node.name}.${one.name}`;
      const past = element('button', 'history', { 'aria-label': `History of ${one.name}` });
      past.onclick = () => showHistory(path);
      const age = one.age < 120 ? `${one.age.toFixed(1)} s` : `${(one.age / 60).toFixed(0)} min`;
      const buttons = element('span');
      buttons.append(past, ' ', whyButton(path));
      const value = element('span', one.text.length > 160 ? `${one.text.slice(0, 160)} \u2026` : one.text, { title: one.text });
      value.append(element('br'), element('small', `${one.writer}, ${age} ago`, { class: 'soft' }));
      return [one.name, value, buttons];
    });
    const edges = node.edges.map((edge) => [other(edge.from, edge.from_id), edge.label, other(edge.to, edge.to_id)]);
    place.replaceChildren(title, table(['attribute', 'value, by whom, how old', ''], rows), element('h2', 'Edges'), table(['from', 'label', 'to'], edges));
    if (mayEdit()) place.append(setForm(node));
  } catch (error) { say(error.message, true); }
}

function other(name, id) {
  const button = element('button', name);
  button.onclick = () => go(id);
  return button;
}

function whyButton(path) {
  const button = element('button', 'why', { 'aria-label': `Why ${path}` });
  button.onclick = () => showWhy(path);
  return button;
}

function setForm(node) {
  const form = element('form');
  const name = element('input', null, { placeholder: 'attribute', 'aria-label': 'Attribute', required: '' });
  const value = element('input', null, { placeholder: 'value', 'aria-label': 'Value', required: '' });
  form.append(name, value, element('button', 'Set'));
  form.onsubmit = (e) => { e.preventDefault(); edit({ kind: 'set', path: `${node.name}.${name.value}`, value: value.value }); };
  return form;
}

async function showWhy(path) {
  try {
    const { text } = await ask('why', { path, ...then() });
    const back = element('button', 'back');
    back.onclick = () => (state.chosen === null ? $('selected').replaceChildren() : showNode(state.chosen));
    $('selected').replaceChildren(element('h2', `Why ${path}`), element('pre', text), back);
    $('details').focus();
  } catch (error) { say(error.message, true); }
}

async function showHistory(path) {
  try {
    const { entries } = await ask('history', { path, ...then() });
    const rows = entries.map((entry) => [clock(entry.time), entry.agent, (entry.rules ?? []).join(', '), entry.text ?? JSON.stringify(entry.value)]);
    const back = element('button', 'back');
    back.onclick = () => showNode(state.chosen);
    $('selected').replaceChildren(element('h2', `History of ${path}`), table(['time', 'by', 'rule', 'value'], rows), back);
  } catch (error) { say(error.message, true); }
}

function go(id) {
  const node = graph.nodes.get(id);
  if (node && state.tab === 'graph') board.centre(node.x, node.y);
  choose(id);
}

function showText() {
  if (state.tab === 'mission') {
    const now = state.at ?? state.about.newest;
    missions($('text'), state.missions, state.agenda, map.map, now, { why: showWhy, ask: mayEdit() ? edit : null });
    if (mayEdit()) $('text').append(missionForm(), ruleForm());
  } else if (state.tab === 'agents') agents($('text'), state.processes, state.rates);
}

function missionForm() {
  const form = element('form');
  const name = element('input', null, { placeholder: 'name', 'aria-label': 'Name of the mission', required: '' });
  const goal = element('textarea', null, { placeholder: 'goal in AGGL', 'aria-label': 'Goal', required: '', rows: '3' });
  form.append(element('h3', 'Submit a mission'), name, goal, element('button', 'Submit'));
  form.onsubmit = (e) => { e.preventDefault(); edit({ kind: 'mission', name: name.value, goal: goal.value }); };
  return form;
}

function ruleForm() {
  const form = element('form');
  const rule = element('input', null, { placeholder: 'rule', 'aria-label': 'Rule', required: '' });
  const bound = element('input', null, { placeholder: 'variable=node, ...', 'aria-label': 'Binding' });
  form.append(element('h3', 'Apply a rule'), rule, bound, element('button', 'Apply'));
  form.onsubmit = (e) => {
    e.preventDefault();
    const pairs = bound.value.split(',').map((pair) => pair.split('=').map((part) => part.trim())).filter(([variable]) => variable);
    edit({ kind: 'rule', rule: rule.value, binding: Object.fromEntries(pairs) });
  };
  return form;
}

function describe() {
  $('canvas').setAttribute('aria-label', (state.tab === 'map' ? map : graph).describe());
}

function show(tab) {
  state.tab = tab;
  for (const button of document.querySelectorAll('[role=tab]')) {
    const chosen = button.id === `tab-${tab}`;
    button.setAttribute('aria-selected', chosen);
    button.tabIndex = chosen ? 0 : -1;
  }
  $('view').setAttribute('aria-labelledby', `tab-${tab}`);
  const drawn = tab === 'graph' || tab === 'map';
  $('canvas').hidden = !drawn;
  $('canvas').style.display = drawn ? '' : 'none';
  $('tools').style.display = tab === 'graph' ? '' : 'none';
  $('text').hidden = drawn;
  if (drawn) { board.show(tab === 'map' ? map : graph); board.resize(); describe(); }
  if (tab === 'map' && state.at === null) loadGrid();
  showText();
  location.hash = new URLSearchParams({ ...(token ? { token } : {}), ...(still ? { still: '' } : {}), view: tab }).toString();
}

// Time.

const span = () => [state.about.oldest, state.about.newest];

function showClock() {
  const [oldest, newest] = span();
  const at = state.at ?? newest;
  $('clock').value = `${clock(at)} (${(at - newest).toFixed(1)} s)`;
  $('time').value = newest > oldest ? (1000 * (at - oldest)) / (newest - oldest) : 1000;
  $('time').setAttribute('aria-valuetext', $('clock').value);
  $('now').setAttribute('aria-pressed', state.at === null);
}

let loading = false;
let again = false;
async function load() {
  // One at a time; what was asked meanwhile is done once at the end.
  if (loading) { again = true; return; }
  loading = true;
  try {
    await Promise.all([loadGraph(), loadRest()]);
    if (state.chosen !== null && graph.nodes.has(state.chosen)) await showNode(state.chosen);
  } catch (error) { say(error.message, true); }
  loading = false;
  if (again) { again = false; load(); }
}

function goTo(at) {
  const [oldest, newest] = span();
  state.at = at === null || (state.about.live && at >= newest) ? null : Math.min(Math.max(at, oldest), newest);
  showClock();
  load();
}

function play() {
  if (state.playing) { clearInterval(state.playing); state.playing = null; } else {
    if (state.at === null) state.at = span()[0];
    state.playing = setInterval(() => {
      if (state.at === null || (!state.about.live && state.at >= span()[1])) { play(); return; }
      goTo(state.at + 0.2);
    }, 200);
  }
  $('play').setAttribute('aria-label', state.playing ? 'Pause' : 'Play');
  $('play').textContent = state.playing ? '\u23f8' : '\u25b6';
}

// What happens.

function tell(frame) {
  if (frame.processes) state.processes = frame.processes;
  state.about.newest = Math.max(state.about.newest, frame.time);
  for (const commit of frame.commits ?? []) {
    const rate = state.rates.get(commit.agent) ?? { count: 0, since: commit.time, rate: 0 };
    rate.count += 1;
    rate.time = commit.time;
    if (commit.time - rate.since > 2) Object.assign(rate, { rate: rate.count / (commit.time - rate.since), count: 0, since: commit.time });
    state.rates.set(commit.agent, rate);
  }
  if (state.at !== null) { showClock(); return; }
  showCommits(frame.commits ?? []);
  if (frame.structure) loadGraph().catch((error) => say(error.message, true));
  if (state.tab === 'graph') graph.light(frame.changed ?? []);
  if (frame.map) map.set(frame.map);
  if (frame.missions) state.missions = frame.missions;
  if (frame.missions || frame.processes) showText();
  if (state.tab === 'map') loadGrid();
  say(`live, version ${frame.version}`);
  showClock();
}

function showCommits(commits) {
  for (const commit of commits) {
    const line = element('li');
    line.append(element('span', clock(commit.time), { class: 'soft' }), ' ', element('b', commit.agent), ' ');
    if (commit.rules.length) line.append(element('span', commit.rules.join(', '), { class: 'rule' }), ' ');
    line.append(commit.what ?? '');
    line.title = `version ${commit.version}`;
    $('log').prepend(line);
  }
  while ($('log').children.length > 80) $('log').lastChild.remove();
}

function listen() {
  const events = new EventSource('/api/events');
  events.onopen = () => { say('live'); load(); };
  events.onmessage = (message) => tell(JSON.parse(message.data));
  events.onerror = () => say('not connected: the program has ended, or is starting again', true);
}

async function begin() {
  state.about = await ask('about');
  $('instance').textContent = state.about.instance;
  if (!state.about.live) { state.at = state.about.newest; $('now').disabled = true; say('a recording'); load(); } else if (still) load(); else listen();
  showClock();
  const wanted = hash.get('view');
  show(['graph', 'map', 'mission', 'agents'].includes(wanted) ? wanted : 'graph');
}

for (const button of document.querySelectorAll('[role=tab]')) {
  button.onclick = () => show(button.id.slice(4));
  button.onkeydown = (e) => {
    const step = { ArrowRight: 'nextElementSibling', ArrowLeft: 'previousElementSibling' }[e.key];
    if (step && button[step]) { button[step].focus(); button[step].click(); }
  };
}
$('now').onclick = () => goTo(null);
$('play').onclick = play;
$('time').oninput = () => { const [a, b] = span(); goTo(a + ((b - a) * $('time').value) / 1000); };
$('search').onchange = () => { const found = graph.find($('search').value); if (found) go(found.id); else say(`there is no node ${$('search').value}`, true); };
document.addEventListener('keydown', (e) => {
  if (e.target.matches('input, textarea') || e.ctrlKey || e.metaKey || e.altKey) return;
  const key = e.key.toLowerCase();
  if (key === '/') { show('graph'); $('search').focus(); } else if (key === 'n') goTo(null);
  else if (key === ' ' && !e.target.matches('button')) play();
  else if (['1', '2', '3', '4'].includes(key)) show(['graph', 'map', 'mission', 'agents'][key - 1]);
  else return;
  e.preventDefault();
});
begin().catch((error) => say(error.message, true));
