// node check_sound.mjs PAGE.html STRUCK.json: hears a page of limber-view in headless Chromium. STRUCK.json has a blow and its samples
// by C++ (make_scene.cpp).
import { readFileSync } from 'node:fs';
import { check, isSafe, open, run, until } from './browser.mjs';

const [file, struckFile] = process.argv.slice(2);
const struck = JSON.parse(readFileSync(struckFile, 'utf8'));
/** The first bending mode of a free bar, f = 1.02792 h/L² √(E/ρ): the bar of make_scene.cpp. */
const PITCH = 1.02792 * (0.00635 / 0.2032 ** 2) * Math.sqrt(200e9 / 7850);
const button = (page) => page.locator('#panel button:text-is("Sound")');

/** Samples of the page's synthesizer, not in real time: left and right by turns. */
const rendered = (page) => page.evaluate(async ({ rate, blow, samples }) => {
  const { limber } = globalThis, context = new OfflineAudioContext(2, samples.length / 2, rate);
  const sound = new limber.sound.constructor(limber);
  await sound.open(context);
  sound.node.disconnect();
  sound.node.connect(context.destination);
  const { port } = sound.node, done = new Promise((resolve) => { port.onmessage = resolve; });
  sound.number(0);
  port.postMessage({ blows: Float64Array.from(blow), done: true });
  await done;
  const buffer = await context.startRendering(), [left, right] = [0, 1].map((channel) => buffer.getChannelData(channel));
  return Array.from({ length: samples.length }, (_, i) => (i % 2 === 0 ? left : right)[i >> 1]);
}, struck);

const largest = (samples) => samples.reduce((most, x) => Math.max(most, Math.abs(x)), 0);

/** Both sum the same modes; without fused multiply-adds the last digits of doubles differ, and samples are rounded to floats. */
function areThoseOfTheLibrary(samples) {
  const peak = largest(struck.samples), off = largest(samples.map((x, i) => x - struck.samples[i]));
  check(peak > 0 && off <= 2 ** -23 * peak, `samples are those of C++: ${off} of ${peak} are off`);
}

/** Where a Hann window of the samples is strongest, Hz. */
function strongest(samples) {
  const windowed = samples.map((x, n) => x * (1 - Math.cos((2 * Math.PI * (n + 0.5)) / samples.length)));
  const power = (hz) => {
    let re = 0, im = 0;
    windowed.forEach((x, n) => {
      re += x * Math.cos((2 * Math.PI * hz * n) / struck.rate);
      im += x * Math.sin((2 * Math.PI * hz * n) / struck.rate);
    });
    return re * re + im * im;
  };
  let best = 0;
  for (let hz = 100, most = 0; hz < 6000; hz += 6) {
    const here = power(hz);
    if (here > most) [best, most] = [hz, here];
  }
  return best;
}

/** By Bernstein's inequality no wave below f makes steps above 2π f/rate of its peak. Nothing here swings faster than 5 kHz. */
function doNotClick(samples) {
  const left = samples.filter((_, i) => i % 2 === 0), peak = largest(left);
  const step = largest(left.map((x, n) => x - (n > 0 ? left[n - 1] : 0)));
  check(step < ((2 * Math.PI * 5000) / struck.rate) * peak, `no sample jumps: by ${step} of ${peak}`);
  const first = left.findIndex((x) => x !== 0);
  check(Math.abs(first - struck.blow[11] * struck.rate) <= 2, `the blow begins at its time: ${first}`);
  check(Math.abs(left[first]) < 1e-3 * peak, `it begins smoothly: by ${left[first]} of ${peak}`);
}

/** Listens at the loudspeaker. */
const level = (page) => page.evaluate(() => {
  const { sound } = globalThis.limber;
  if (sound.ear === undefined) {
    sound.ear = new AnalyserNode(sound.context, { fftSize: 4096 });
    sound.volume.connect(sound.ear);
  }
  const samples = new Float32Array(4096);
  sound.ear.getFloatTimeDomainData(samples);
  return Math.max(...samples.map(Math.abs));
});

const middle = (page) => page.evaluate(() => {
  const { stage } = globalThis.limber, box = stage.renderer.domElement.getBoundingClientRect();
  const p = stage.controls.target.clone().project(stage.camera);
  return [box.left + ((p.x + 1) * box.width) / 2, box.top + ((1 - p.y) * box.height) / 2];
});

async function soundsWhenAsked(page) {
  const state = () => page.evaluate(() => globalThis.limber.sound.context?.state ?? 'none');
  await page.locator('#panel button:has-text("Poke")').click();
  await page.mouse.click(...(await middle(page)));
  check((await state()) === 'none', 'nothing sounds before one asks for it');
  await page.evaluate(() => globalThis.limber.restart());
  check(await button(page).isVisible(), 'there is a button for the sound');
  await button(page).click();
  check(await until(async () => (await state()) === 'running'), `it is switched on: ${await state()}`);
  check(await until(() => page.evaluate(() => globalThis.limber.sound.node !== undefined)), 'and opened');
  check((await level(page)) === 0, 'it is silent at first');
  await page.locator('#panel button:has-text("Poke")').click();
  await page.mouse.click(...(await middle(page)));
  check(await until(async () => (await level(page)) > 1e-3), 'one hears what one pokes');
  check((await level(page)) < 1, 'and it is not too loud for the loudspeaker');
  await button(page).click();
  check(await until(async () => (await state()) === 'suspended'), 'it is switched off again');
}

await run('check_sound', file, async () => {
  const page = await open(file);
  await isSafe(page, file);
  const samples = await rendered(page);
  areThoseOfTheLibrary(samples);
  doNotClick(samples);
  const hz = strongest(samples.filter((_, i) => i % 2 === 0));
  check(Math.abs(hz - PITCH) < 0.01 * PITCH, `a bar of ${PITCH.toFixed(1)} Hz is heard at ${hz} Hz`);
  await soundsWhenAsked(page);
  await page.close();
});
