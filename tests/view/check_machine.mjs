// node check_machine.mjs PAGE.html [PICTURE.png]: opens a page of a machine in headless Chromium, from disk: a post that stands and
// an arm on a hinge, which is led, runs and is stopped. Every claim that does not hold is a line, and the exit code is 1.
import { check, open, run, until, wrong } from './browser.mjs';

const [file, picture] = process.argv.slice(2);
const DEGREE = Math.PI / 180;

const steps = (page, count) => page.evaluate((count) => {
  const app = globalThis.limber;
  for (let i = 0; i < count; ++i) app.step();
  app.show();
  return app.engine.jointFrames()[6];
}, count);
const row = (page) => page.locator('#panel details:has(> summary:has-text("– arm"))');

/** What one puts down stays there: friction bears it. */
async function stays(page) {
  check(Math.abs(await steps(page, 120)) < 2 * DEGREE, `the arm stays where it is put: ${await steps(page, 0)} rad`);
  const { ground, low } = await page.evaluate(() => {
    const app = globalThis.limber, heights = [...app.engine.reconstruct(0)].filter((_, i) => i % 3 === 2);
    return { ground: app.engine.scene.statics.some((shape) => shape.ground), low: Math.min(...heights) };
  });
  check(ground && Math.abs(low) < 1e-3, `the post stands on the ground, its foot at ${low} m`);
}

/** A slider in degrees leads a joint, as far as its stops; a motor turns it; a stop leaves it where it is. */
async function isLed(page) {
  const slider = row(page).locator('input[type="range"]');
  check((await row(page).textContent()).includes('stops at -85.9° and 57.3°'), `stops are told in degrees: ${await row(page).textContent()}`);
  await slider.evaluate((input) => { input.value = -0.5; input.dispatchEvent(new Event('input')); });
  const led = await steps(page, 60);
  check(Math.abs(led + 0.5) < 2 * DEGREE, `the slider leads it: to ${led} of -0.5 rad`);
  check((await row(page).locator('output').textContent()) === `${(led / DEGREE).toFixed(1)}°`, 'where it is stands beside the slider');
  await row(page).locator('button:has-text("Run")').click();
  const before = await steps(page, 0), turned = await steps(page, 20) - before;
  check(Math.abs(turned - 90 * DEGREE / 3) < 0.2, `a motor turns it by 90° a second: by ${turned} rad in a third`);
  check((await row(page).locator('button:has-text("Run")').getAttribute('aria-pressed')) === 'true', 'the button shows that it runs');
  await row(page).locator('button:has-text("Stop")').click();
  const stopped = await steps(page, 30);
  check(Math.abs(await steps(page, 60) - stopped) < 2 * DEGREE, 'and it stays where it is stopped');
}

/** A part made softer rings lower, and goes on from where it is. */
async function isMadeSoft(page) {
  const look = () => page.evaluate(() => {
    const { engine } = globalThis.limber, { models, bodies } = engine.scene, { model } = bodies.find(({ name }) => name.includes('arm'));
    return { frequencies: models[model].frequencies, frame: [...engine.frame()], turn: engine.jointFrames()[6] };
  });
  const before = await look(), choice = page.locator('#panel details:has(> summary:text-is("Stiffness")) label:has-text("arm") select');
  await choice.selectOption('0.01');
  const soft = await look();
  check(soft.frequencies.length > 0 && soft.frequencies.every((hz, i) => Math.abs(hz / before.frequencies[i] - 0.1) < 1e-9), `a hundredth of the modulus, a tenth of the frequencies: ${soft.frequencies}`);
  check(soft.frame.every((x, i) => x === before.frame[i]), 'it goes on from where it is');
  check(Math.abs(await steps(page, 30) - before.turn) < 10 * DEGREE, 'and stays on its hinge');
  await choice.selectOption('null');
  check((await look()).frequencies.length === 0, 'a rigid one has no modes');
  await steps(page, 10);
  await choice.selectOption('1');
  check(JSON.stringify((await look()).frequencies) === JSON.stringify(before.frequencies), 'and gets them back');
}

/** Contacts, their forces, and the surfaces that touch are drawn when a person asks for them. */
async function showsContacts(page) {
  await page.evaluate(() => {
    const app = globalThis.limber;
    app.drop(1);
    app.resume();
  });
  const seen = () => page.evaluate(() => {
    const { marks } = globalThis.limber.panel, count = ({ geometry, visible }) => (visible ? geometry.attributes.position?.count ?? 0 : 0);
    return { points: count(marks.points), ends: count(marks.forces), wires: marks.group.visible ? marks.wires.length : 0,
      contacts: globalThis.limber.engine.contacts().length / 6, axes: globalThis.limber.stage.joints.visible };
  });
  await steps(page, 150);
  check((await seen()).points === 0 && (await seen()).wires === 0, 'nothing is drawn that was not asked for');
  await page.locator('#panel label:has-text("Contacts") input').check();
  await page.locator('#panel label:has-text("What touches") input').check();
  await steps(page, 1);
  const { points, ends, wires, contacts } = await seen();
  check(contacts > 0 && points === contacts && ends === 2 * contacts, `each of ${contacts} contacts is a point with a force: ${points}, ${ends} ends`);
  check(wires === 3, `what touches is drawn of each body: ${wires}`);
  await page.locator('#panel label:has-text("Axes") input').uncheck();
  await steps(page, 1);
  check(!(await seen()).axes, 'axes of joints may be left out');
  if (picture !== undefined) await page.screenshot({ path: picture });
}

await run('check_machine', file, async () => {
  const page = await open(file, undefined, '#paused');
  check(await until(() => page.evaluate(() => globalThis.limber !== undefined)), 'it opens');
  if (wrong.length === 0) {
    await stays(page);
    await isLed(page);
    await isMadeSoft(page);
    await showsContacts(page);
    check((await page.evaluate(() => document.querySelectorAll('#panel b').length)) === 0, 'no text has become markup');
  }
  await page.close();
});
