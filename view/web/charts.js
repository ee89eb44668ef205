// A strip chart of the last numbers.
import { element } from './dom.js';

const LENGTH = 240;
const short = (x) => String(Number(x.toPrecision(3)));

export class Chart {
  /** @param series [[name, colour]] */
  constructor(title, unit, series) {
    this.canvas = element('canvas', { width: 512, height: 112 });
    this.caption = element('small');
    this.title = title;
    this.unit = unit;
    this.series = series;
    this.clear();
    this.element = element('div', {}, this.canvas, this.caption);
  }

  clear() {
    this.rows = [];
  }

  add(values) {
    this.rows.push(values);
    if (this.rows.length > LENGTH) this.rows.shift();
  }

  draw() {
    const c = this.canvas.getContext('2d'), { width, height } = this.canvas;
    c.clearRect(0, 0, width, height);
    if (this.rows.length === 0) return;
    let low = 0, high = 1e-12;
    for (const row of this.rows) for (const x of row) low = Math.min(low, x), high = Math.max(high, x);
    const y = (x) => height - 4 - ((x - low) / (high - low)) * (height - 8);
    c.fillStyle = '#5d6778';
    c.font = '20px system-ui, sans-serif';
    c.fillText(short(high), 4, 20);
    c.fillText(short(low), 4, height - 4);
    this.series.forEach(([, colour], s) => {
      c.strokeStyle = colour;
      c.lineWidth = 2.5;
      c.beginPath();
      this.rows.forEach((row, i) => c.lineTo((i / LENGTH) * width, y(row[s])));
      c.stroke();
    });
    const last = this.rows[this.rows.length - 1];
    this.caption.textContent = `${this.title}: ${this.series.map(([name], s) => `${name} ${short(last[s])}`).join(', ')} ${this.unit}`;
  }
}
