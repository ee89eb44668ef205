// node check_pose.mjs PAGE.html [PICTURE.png]: opens a page of limber-view --joints in headless Chromium, from disk, and poses the
// model as a person would: two hinged bars, of which the first is pinned. Every claim that does not hold is a line, and the
// exit code is 1.
import { readFileSync } from 'node:fs';
import { check, isSafe, open, run, until, wrong } from './browser.mjs';

const [file, picture] = process.argv.slice(2);

/** Looks for the pose until it is found. */
const settled = (page) => page.evaluate(() => {
  const app = globalThis.limber;
  for (let tries = 0; tries < 200 && (tries === 0 || app.unsettled); ++tries) app.frame();
  return { ...app.result, positions: [...app.engine.positions()], frames: [...app.engine.jointFrames()] };
});
/** Where a part is on the screen: the middle of a triangle that nothing hides, towards the part's end. */
const onScreen = (page, part) => page.evaluate((part) => {
  const app = globalThis.limber, { stage, engine } = app, canvas = stage.renderer.domElement.getBoundingClientRect();
  const positions = engine.positions(), p = stage.controls.target.clone(), found = [];
  stage.camera.updateMatrixWorld();
  const first = 3 * engine.scene.parts.slice(0, part).reduce((sum, { triangles }) => sum + triangles, 0);
  for (let t = first; t < first + 3 * engine.scene.parts[part].triangles; t += 3) {
    p.set(0, 0, 0);
    for (let i = 0; i < 3; ++i) for (let k = 0; k < 3; ++k) p.setComponent(k, p.getComponent(k) + positions[3 * engine.triangles[t + i] + k] / 3);
    const along = p.x;
    p.project(stage.camera);
    const at = { clientX: Math.round(canvas.left + (p.x + 1) * 0.5 * canvas.width), clientY: Math.round(canvas.top + (1 - p.y) * 0.5 * canvas.height) };
    const { from, along: direction } = stage.ray(at);
    if (engine.cast(from, direction)?.part === part && document.elementFromPoint(at.clientX, at.clientY) === stage.renderer.domElement) found.push([along, at.clientX, at.clientY]);
  }
  found.sort((a, b) => b[0] - a[0]);
  return found.length > 0 ? found[0].slice(1) : null;
}, part);
async function pull(page, from, by) {
  await page.mouse.move(...from);
  await page.mouse.down();
  await page.mouse.move(from[0] + by[0], from[1] + by[1], { steps: 5 });
  const pose = await settled(page);
  await page.mouse.up();
  return pose;
}
const turn = (pose) => pose.frames[6];
const moved = (a, b) => Math.max(...a.positions.map((x, i) => Math.abs(x - b.positions[i])));

async function isPulled(page) {
  const rest = await settled(page);
  check(rest.status === 'converged', 'the pose at rest is one');
  const at = await onScreen(page, 1);
  check(at !== null, 'the second part is seen');
  const pulled = await pull(page, at, [0, -70]);
  check(Math.abs(turn(pulled)) > 0.1, `it turns in its hinge, ${turn(pulled)} rad`);
  check(pulled.jointError < 1e-6 && pulled.limitViolation < 1e-6, `the joint holds, ${pulled.jointError}`);
  const part = await page.evaluate(() => globalThis.limber.engine.scene.parts[0].triangles);
  check(part > 0 && moved({ positions: pulled.positions.slice(0, 24) }, { positions: rest.positions.slice(0, 24) }) < 1e-6, 'what is pinned stays');
  check((await page.evaluate(() => globalThis.limber.engine.handles().length)) === 1, 'the handle stays');
  const handle = await page.evaluate(() => {
    const { stage, engine } = globalThis.limber, p = stage.controls.target.clone().fromArray(engine.handles()[0].point).project(stage.camera);
    const canvas = stage.renderer.domElement.getBoundingClientRect();
    return [canvas.left + (p.x + 1) * 0.5 * canvas.width, canvas.top + (1 - p.y) * 0.5 * canvas.height];
  });
  const further = await pull(page, handle, [0, 40]);
  check((await page.evaluate(() => globalThis.limber.engine.handles().length)) === 1, 'it is taken again');
  check(moved(further, pulled) > 1e-3, 'and leads the part on');
  const beyond = await pull(page, await onScreen(page, 1), [0, -400]);
  check(Math.abs(turn(beyond)) < 1.0 + 1e-6, `the limit holds, ${turn(beyond)} rad`);
}

/** A line across a part cuts it in two, on a ball; undone, it is one again. */
async function isCut(page) {
  await page.locator('#panel button:has-text("Back to rest")').click();
  await settled(page);
  const ends = await page.evaluate(() => {
    const { stage } = globalThis.limber, canvas = stage.renderer.domElement.getBoundingClientRect();
    stage.camera.updateMatrixWorld();
    return [-0.3, 0.5].map((z) => {
      const p = stage.controls.target.clone().set(1.5, 0.1, z).project(stage.camera);
      return [canvas.left + (p.x + 1) * 0.5 * canvas.width, canvas.top + (1 - p.y) * 0.5 * canvas.height];
    });
  });
  const look = () => page.evaluate(() => {
    const { engine, geometry, mesh } = globalThis.limber;
    return { parts: engine.scene.parts.length, joints: engine.scene.joints.map(({ type }) => type), groups: geometry.groups.length, materials: mesh.material.length };
  });
  const before = await look();
  await page.locator('#panel button:has-text("Cut")').click();
  await page.mouse.move(...ends[0]);
  await page.mouse.down();
  await page.mouse.move(...ends[1], { steps: 3 });
  await page.mouse.up();
  const cut = await look();
  check(cut.parts === before.parts + 1 && cut.groups === cut.parts && cut.materials === cut.parts, `a line across a part makes two of it: ${JSON.stringify(cut)}`);
  check(cut.joints.at(-1) === 'ball' && cut.joints.length === before.joints.length + 1, 'with a ball between');
  const rest = await settled(page), pulled = await pull(page, await onScreen(page, cut.parts - 1), [0, -60]);
  check(moved(pulled, rest) > 0.02 && pulled.jointError < 1e-6, `the piece is pulled, by ${moved(pulled, rest)}, and hangs on its joint`);
  for (let tries = 0; tries < 20 && (await look()).parts > before.parts; ++tries) await page.locator('#panel button:has-text("Undo")').click();
  check(JSON.stringify(await look()) === JSON.stringify(before), 'and undone');
}

async function isEdited(page) {
  await page.locator('#panel summary:has-text("<b>base</b>")').click();
  const high = page.locator('#panel label.ends input').nth(0), low = page.locator('#panel label.ends input').nth(1);
  await high.fill('-5');
  await high.press('Enter');
  await low.fill('5');
  await low.press('Enter');
  const narrow = await settled(page);
  check(Math.abs(turn(narrow)) <= 5 * Math.PI / 180 + 1e-6, `new limits hold at once, ${turn(narrow)} rad`);
  await page.locator('#panel select').first().selectOption('fixed');
  await settled(page);
  check((await page.evaluate(() => globalThis.limber.engine.scene.joints[0].type)) === 'fixed', 'the joint is another');
  await page.locator('#panel button:has-text("Undo")').click();
  check((await page.evaluate(() => globalThis.limber.engine.scene.joints[0].type)) === 'revolute', 'and undone');
}

async function bends(page) {
  await page.locator('#panel button:has-text("Back to rest")').click();
  await page.locator('#panel select').first().selectOption('fixed');
  const rest = await pull(page, await onScreen(page, 1), [0, -60]);
  await page.locator('#panel .part').nth(1).locator('input[type="checkbox"]').first().check();
  const bent = await settled(page);
  check((await page.evaluate(() => globalThis.limber.engine.scene.parts[1].soft)) === true, 'a part is made soft');
  check(moved(bent, rest) > 0.02, `it bends, by ${moved(bent, rest)}`);
  check(bent.jointError < 1e-6, 'and hangs on its joint');
}

async function isSaved(page) {
  const name = page.locator('#panel .part input[type="text"]').nth(1);
  await name.fill('<i>boom</i>');
  await name.press('Enter');
  const files = [];
  page.on('download', (file) => files.push(file));
  await page.locator('#panel button:has-text("Save")').click();
  const saved = await until(() => files.length === 2);
  check(saved, 'the pose is saved as two files');
  if (!saved) return;
  const texts = await Promise.all(files.map(async (file) => readFileSync(await file.path(), 'utf8')));
  check(texts.some((text) => /^v /m.test(text) && /^f /m.test(text)), 'one is a model');
  check(texts.some((text) => text.startsWith('{"components"') && text.includes('"<i>boom</i>"')), 'one its joints, of parts by the names that they were given');
}

await run('check_pose', file, async () => {
  const page = await open(file);
  check(await page.evaluate(() => globalThis.limber !== undefined), `it opens: "${await page.evaluate(() => document.getElementById('message').textContent)}"`);
  if (wrong.length === 0) {
    await isSafe(page, file);
    await isPulled(page);
    if (picture !== undefined) await page.screenshot({ path: picture });
    await isEdited(page);
    await bends(page);
    await isSaved(page);
    await isCut(page);
    check((await page.evaluate(() => document.querySelectorAll('img, iframe, object, embed, b, i').length)) === 0, 'no text has become markup');
  }
  await page.close();
});
