// Pieces of a page, and words for times.

export function element(tag, text, attributes = {}) {
  const made = document.createElement(tag);
  if (text !== undefined && text !== null) made.textContent = text;
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  return made;
}

// A button that can be found again by its key after its place was written anew.
export function button(text, act, { label, key, link, title } = {}) {
  const made = element('button', text, { type: 'button' });
  if (label) made.setAttribute('aria-label', label);
  if (title) made.title = title;
  if (link) made.className = 'link';
  made.dataset.key = key ?? label ?? text;
  made.onclick = act;
  return made;
}

// Writes a place anew; what had the focus there has it again.
export function renew(place, ...parts) {
  const key = place.contains(document.activeElement) ? document.activeElement.dataset.key : undefined;
  place.replaceChildren(...parts);
  if (key !== undefined) [...place.querySelectorAll('[data-key]')].find((one) => one.dataset.key === key)?.focus({ preventScroll: true });
}

export function table(headings, rows, caption) {
  const made = element('table');
  if (caption) made.setAttribute('aria-label', caption);
  const head = made.createTHead().insertRow();
  for (const heading of headings) head.append(element(heading ? 'th' : 'td', heading, heading ? { scope: 'col' } : {}));
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

export function clock(seconds) {
  if (seconds === null || seconds === undefined) return '';
  return new Date(seconds * 1000).toISOString().slice(11, 21);
}

export const ago = (seconds) => (seconds < 120 ? `${seconds.toFixed(1)} s` : seconds < 7200 ? `${(seconds / 60).toFixed(0)} min` : `${(seconds / 3600).toFixed(0)} h`);
