// Elements are made of texts, never of markup.
export function element(tag, properties = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (name.startsWith('on')) made.addEventListener(name.slice(2), value);
    else if (name.startsWith('aria-') || name === 'role' || name === 'for') made.setAttribute(name, value);
    else made[name] = value;
  }
  made.append(...children);
  return made;
}

export function button(text, act, properties = {}) {
  return element('button', { type: 'button', textContent: text, onclick: act, ...properties });
}

/** A labelled slider. @param show from the number to its text */
export function slider(text, { min, max, step, value, show = (x) => x.toPrecision(3) }, act) {
  const output = element('output', { textContent: show(value) });
  const input = element('input', { type: 'range', min, max, step });
  input.value = value;
  input.addEventListener('input', () => {
    output.textContent = show(Number(input.value));
    act(Number(input.value));
  });
  const label = element('label', {}, text, input, output);
  label.set = (x) => {
    input.value = x;
    output.textContent = show(x);
  };
  return label;
}

export function choice(text, options, value, act) {
  const select = element('select', { onchange: () => act(select.value) },
    ...options.map(([name, shown]) => element('option', { value: name, textContent: shown })));
  select.value = value;
  return element('label', {}, text, select, '');
}

/** A file, to the browser's downloads. */
export function download(content, type, name) {
  const address = URL.createObjectURL(new Blob([content], { type }));
  element('a', { href: address, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(address), 10000);
}

/** Below this width the panel lies at the foot of the page. style.css has the same. */
export const NARROW = '(max-width: 700px)';

/** The panel: a bar of buttons that fold and unfold its sheets. All are open beside a wide picture, one at most below a narrow one. */
export class Sheets {
  /** @param changed is called after the panel took another size */
  constructor(host, titles, changed) {
    this.host = host;
    this.changed = changed;
    this.narrow = matchMedia(NARROW);
    this.sheets = titles.map(() => element('div', { className: 'sheet' }));
    this.buttons = titles.map((title, i) => button(title, () => this.open(this.sheets.map(({ hidden }, j) =>
      (i === j ? hidden : !hidden && !this.narrow.matches)))));
    host.replaceChildren(element('nav', { className: 'row' }, ...this.buttons), ...this.sheets);
    this.narrow.addEventListener('change', () => this.begin());
    this.begin();
  }

  begin() { this.open(this.sheets.map(() => !this.narrow.matches)); }

  open(which) {
    which.forEach((opened, i) => {
      this.sheets[i].hidden = !opened;
      this.buttons[i].setAttribute('aria-expanded', String(opened));
    });
    this.host.className = which.includes(true) ? '' : 'folded';
    this.changed();
  }

  fill(...contents) { contents.forEach((content, i) => this.sheets[i].replaceChildren(...content)); }
}

export function section(title, open, ...children) {
  return element('details', { open }, element('summary', { textContent: title }), ...children);
}
