// The page as it stands, as a page of its own.
/** JSON in which no markup can stand, for the inside of a script element. */
const safe = (value) => JSON.stringify(value).replace(/[<>&]/g, (c) => `\\u00${c.charCodeAt(0).toString(16)}`);

/** Texts of the page as it came, before anything is drawn into it. */
export class Original {
  constructor() {
    this.loading = document.getElementById('loading').cloneNode(true);
  }

  /** @param stands what the page is to go on from: {state, view, playing} @return the text of an HTML file */
  with(stands) {
    const page = document.documentElement.cloneNode(true), find = (id) => page.querySelector(`#${id}`);
    const canvas = document.createElement('canvas');
    canvas.id = 'view';
    canvas.setAttribute('aria-label', find('view').getAttribute('aria-label'));
    find('view').replaceWith(canvas);
    find('panel').replaceChildren();
    find('panel').removeAttribute('class');
    find('message').textContent = '';
    find('message').removeAttribute('class');
    find('message').after(this.loading.cloneNode(true));
    find('files').textContent = safe({ ...JSON.parse(find('files').textContent), stands });
    return `<!doctype html>\n${page.outerHTML}\n`;
  }
}

/** What the app's page goes on from. */
export function standing(app) {
  const { camera, controls } = app.stage;
  return {
    state: app.engine.saved(),
    view: { position: camera.position.toArray(), target: controls.target.toArray() },
    playing: app.playing,
  };
}
