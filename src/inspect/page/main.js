// The page: what is chosen, as of when, and in which view. Everything it knows it asks of the program
// that served it.

import { Strip } from './agenda.js';
import { Board, colour } from './canvas.js';
import { Details } from './details.js';
import { button, clock, element } from './element.js';
import { missionForm, ruleForm } from './forms.js';
import { GraphView } from './graph.js';
import { Log } from './log.js';
import { LAYERS, MapView } from './map.js';
import { agents, changeActivity, missions } from './mission.js';

const $ = (id) => document.getElementById(id);
const TABS = ['graph', 'map', 'mission', 'agents'];
const state = { about: null, at: null, tab: 'graph', playing: null, missions: [], agenda: null, processes: null, asked: new Map() };
const hash = new URLSearchParams(location.hash.slice(1));
const token = hash.get('token');
const still = hash.has('still'); // looks once and follows nothing: for pictures

async function answered(response) {
  const json = await response.json();
  if (!response.ok) throw Object.assign(new Error([json.error, json.help].filter(Boolean).join('; ')), { report: json.report });
  return json;
}

async function ask(what, question = {}) {
  const given = Object.entries({ at: state.at, ...question }).filter(([, value]) => value !== null && value !== undefined);
  return answered(await fetch(`/api/${what}?${new URLSearchParams(given)}`));
}

async function edit(change) {
  const json = await answered(await fetch('/api/edit', { method: 'POST', headers: { 'x-cortex-token': token ?? '' }, body: JSON.stringify(change) }));
  details.again();
  loadRest().catch(failed);
  return json;
}

const say = (text, bad = false) => {
  // Only what is new is told aloud.
  if ($('status').textContent !== text) $('status').textContent = text;
  $('status').classList.toggle('bad', bad);
};
const failed = (error) => say(error.message, true);
const mayEdit = () => Boolean(state.about?.allow_edit && token);
const now = () => state.at ?? state.about.newest;
// Whether something was not done for so many milliseconds, and then counts as done.
const due = (what, every) => {
  const time = performance.now();
  if (time - (state.asked.get(what) ?? -Infinity) < every) return false;
  state.asked.set(what, time);
  return true;
};

const why = (path) => details.showWhy(path);
const page = { why, goTo, go, mayEdit, edit, sifted: () => loadLog().catch(failed), changes: (row) => changeActivity($('forms').querySelector('.activity'), row, edit) };
const board = new Board($('canvas'), (id) => choose(id));
const graph = new GraphView(board);
const map = new MapView(board);
const details = new Details($('selected'), ask, page);
const log = new Log({ list: $('log'), ruled: $('ruled'), author: $('author'), held: $('held') }, page);
const strip = new Strip($('strip'), (usage) => { map.usage = usage; board.redraw(); });

async function loadGraph() {
  graph.set(await ask('graph'));
  map.ids = new Map([...graph.nodes.values()].map((node) => [node.name, node.id]));
  const kinds = new Map();
  for (const node of graph.nodes.values()) kinds.set(node.type, (kinds.get(node.type) ?? 0) + 1);
  showChoices($('filters'), [...kinds].sort().map(([type, count]) => [type, colour(type), `${type} ${count}`]), graph.hidden);
  $('names').replaceChildren(...[...graph.nodes.values()].slice(0, 2000).map(({ name }) => element('option', null, { value: name })));
  describe();
  requestAnimationFrame(() => { document.body.dataset.drawn ??= Math.round(performance.now()); });
}

// Boxes for what is shown, each as key, colour and words; what is not ticked is `hidden`.
function showChoices(place, choices, hidden) {
  const told = JSON.stringify(choices);
  if (place.dataset.told === told) return;
  place.dataset.told = told;
  place.replaceChildren(place.querySelector('legend'), ...choices.map(([key, of, words]) => {
    const label = element('label');
    const box = element('input', null, { type: 'checkbox' });
    box.checked = !hidden.has(key);
    box.onchange = () => { hidden[box.checked ? 'delete' : 'add'](key); board.redraw(); };
    const swatch = element('span', null, { class: 'swatch' });
    swatch.style.background = of;
    label.append(box, swatch, words);
    return label;
  }));
}

async function loadLog() {
  log.set(await ask('commits', { rules: $('ruled').checked || null, agent: $('author').value || null }));
}

async function loadAgenda() {
  state.agenda = await ask('agenda');
  strip.set(state.agenda);
}

async function loadRest() {
  const [place, list] = await Promise.all([ask('map'), ask('missions'), loadAgenda(), loadLog()]);
  setMap(place);
  state.missions = list;
  if (state.at === null && state.tab === 'map') loadGrid(); else map.setGrid(null);
  if (state.at !== null) map.setLaser(null);
  showText();
  describe();
}

function setMap(place) {
  map.set(place);
  const told = JSON.stringify(place.problems);
  if ($('problems').dataset.told === told) return;
  $('problems').dataset.told = told;
  $('problems').hidden = !place.problems.length;
  $('problems').replaceChildren(...place.problems.map(({ node, text }) => {
    const line = element('li');
    line.append(button(node, () => go(map.ids.get(node)), { link: true }), `: ${text.trim()}`);
    return line;
  }));
}

async function loadGrid() {
  if (due('grid', 1000)) map.setGrid(await ask('grid', { at: null }).catch(() => null));
}

async function choose(id) {
  graph.selected = map.selected = id;
  board.redraw();
  if (id !== null) say(`${graph.nodes.get(id)?.name ?? id} is chosen`);
  await details.choose(id);
}

function go(id) {
  if (id === undefined) return;
  const node = graph.nodes.get(id);
  if (node && state.tab === 'graph') board.centre(node.x, node.y);
  choose(id);
}

function showText() {
  if (state.tab === 'mission') missions($('told'), state.missions, state.agenda, map.map, now(), { ...page, edit: mayEdit() ? edit : null });
  else if (state.tab === 'agents') agents($('told'), state.processes, now());
  $('forms').hidden = state.tab !== 'mission';
}

async function makeForms() {
  if (!mayEdit()) {
    const help = state.about.live ? 'Start the inspector with --allow-edit, and open the address that it prints, to submit missions, apply rules and change the agenda here.' : 'A recording is read, not written.';
    $('forms').append(element('p', help, { class: 'soft' }));
    return;
  }
  const rules = await ask('rules').catch(() => []);
  $('forms').append(element('div', null, { class: 'activity' }), missionForm(edit), ruleForm(rules, edit));
}

function describe() {
  const what = (state.tab === 'map' ? map : graph).describe();
  const told = `${what}. Arrows move, plus and minus magnify, 0 shows all.`;
  if ($('canvas').getAttribute('aria-label') !== told) $('canvas').setAttribute('aria-label', told);
}

function show(tab) {
  state.tab = tab;
  for (const each of document.querySelectorAll('[role=tab]')) {
    const chosen = each.id === `tab-${tab}`;
    each.setAttribute('aria-selected', chosen);
    each.tabIndex = chosen ? 0 : -1;
  }
  $('view').setAttribute('aria-labelledby', `tab-${tab}`);
  const drawn = tab === 'graph' || tab === 'map';
  $('canvas').hidden = !drawn;
  $('tools-graph').hidden = tab !== 'graph';
  $('tools-map').hidden = $('below').hidden = tab !== 'map';
  $('text').hidden = drawn;
  $('text').setAttribute('aria-label', tab === 'agents' ? 'Agents' : 'Mission');
  if (drawn) { board.show(tab === 'map' ? map : graph); board.resize(); describe(); }
  if (tab === 'map' && state.at === null) loadGrid();
  if (state.about) showText();
  const kept = new URLSearchParams({ ...(token ? { token } : {}), ...(still ? { still: '' } : {}), view: tab });
  history.replaceState(null, '', `#${kept}`);
}

// Time.

const span = () => [state.about.oldest, state.about.newest];

function showClock() {
  const [oldest, newest] = span();
  // On the grid of its steps, so that it comes to its ends.
  [$('time').min, $('time').max] = [Math.floor(oldest * 10 + 1e-5) / 10, Math.ceil(newest * 10 - 1e-5) / 10];
  $('time').value = state.at ?? $('time').max;
  $('clock').value = `${clock(now())} (${(now() - newest).toFixed(1)} s)`;
  // Which is told aloud while it is moved, not with each commit.
  $('time').setAttribute('aria-valuetext', state.at === null ? 'now' : $('clock').value);
  $('now').setAttribute('aria-pressed', state.at === null);
  $('version').hidden = state.at !== null;
}

let loading = false;
let again = false;
async function load() {
  // One at a time; what was asked meanwhile is done once at the end.
  if (loading) { again = true; return; }
  loading = true;
  try {
    await Promise.all([loadGraph(), loadRest()]);
    await details.again();
    showClock();
  } catch (error) { failed(error); }
  loading = false;
  if (again) { again = false; load(); }
}

function goTo(at) {
  const [oldest, newest] = span();
  state.at = at === null || (state.about.live && at >= newest) ? null : Math.min(Math.max(at, oldest), newest);
  say(state.at === null ? 'live' : state.about.live ? 'as it was then: Now goes back' : 'a recording');
  showClock();
  load();
}

function play() {
  if (state.playing) { clearInterval(state.playing); state.playing = null; } else {
    if (state.at === null || (!state.about.live && state.at >= span()[1])) state.at = span()[0];
    state.playing = setInterval(() => {
      if (state.at === null || (!state.about.live && state.at >= span()[1])) { play(); return; }
      if (!loading) goTo(state.at + 0.2);
    }, 200);
  }
  $('play').setAttribute('aria-label', state.playing ? 'Pause' : 'Play');
  $('play').textContent = state.playing ? '\u23f8' : '\u25b6';
}

// What happens.

function tell(frame) {
  if (frame.processes) state.processes = frame.processes;
  state.about.newest = Math.max(state.about.newest, frame.time);
  if (frame.processes && due('about', 5000)) ask('about').then((about) => { state.about.oldest = about.oldest; }, () => {});
  if (frame.missions) state.missions = frame.missions;
  if (state.at !== null) { showClock(); return; }
  log.add(frame.commits);
  if (frame.structure) loadGraph().catch(failed);
  if (state.tab === 'graph') graph.light(frame.changed);
  if (frame.map) setMap(frame.map);
  if (frame.laser) map.setLaser(frame.laser);
  const touched = new Set(frame.changed);
  if (frame.structure || state.agenda?.activities.some((one) => touched.has(one.id))) loadAgenda().then(showText, failed);
  strip.tick(frame.time);
  if (frame.missions || (frame.processes && state.tab === 'agents') || due('text', 10000)) showText();
  if ((touched.has(details.chosen) || frame.processes) && due('node', 900)) details.again();
  if (state.tab === 'map') { loadGrid(); if (due('describe', 1000)) describe(); }
  say('live');
  if (!due('clock', 100)) return;
  $('version').textContent = `, version ${frame.version}`;
  showClock();
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
  makeForms();
  const wanted = hash.get('view');
  show(TABS.includes(wanted) ? wanted : 'graph');
}

for (const tab of document.querySelectorAll('[role=tab]')) {
  tab.onclick = () => show(tab.id.slice(4));
  tab.onkeydown = (e) => {
    const step = { ArrowRight: 'nextElementSibling', ArrowLeft: 'previousElementSibling' }[e.key];
    if (step && tab[step]) { tab[step].focus(); tab[step].click(); }
  };
}
$('now').onclick = () => goTo(null);
$('play').onclick = play;
$('time').oninput = () => goTo(Number($('time').value));
function search() {
  const found = graph.search($('search').value);
  $('found').textContent = $('search').value ? `${found.length} found` : '';
  return found;
}
$('search').oninput = search;
$('search').onchange = () => { const [first] = search(); if (first) go(first.id); };
showChoices($('layers'), LAYERS.map(([layer, of]) => [layer, of, layer]), map.hidden);
const wide = matchMedia('(min-width: 701px)').matches;
for (const each of document.querySelectorAll('.choices, #agenda')) each.open = wide;
$('agenda').ontoggle = () => strip.draw();
document.addEventListener('keydown', (e) => {
  if (e.target.matches('input:not([type=checkbox]):not([type=range]), textarea, select') || e.ctrlKey || e.metaKey || e.altKey) return;
  const key = e.key.toLowerCase();
  if (key === '/') { show('graph'); $('search').focus(); } else if (key === 'n') goTo(null);
  else if (key === ' ' && !e.target.matches('button, input, summary')) play();
  else if (['1', '2', '3', '4'].includes(key)) show(TABS[key - 1]);
  else return;
  e.preventDefault();
});
begin().catch(failed);
