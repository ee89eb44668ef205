// node check_page.mjs scene|asset PAGE.html [PICTURE.png]: opens a page of limber-view in headless Chromium, from disk, and plays
// with it as a person would. Every claim that does not hold is a line, and the exit code is 1. The controls are the same in both:
// the page of a scene is asked about all of them, the page of an asset about what its bodies do.
import { readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { check, folder, isSafe, open, run, until, wrong } from './browser.mjs';

const [kind, file, picture] = process.argv.slice(2), whole = kind === 'scene';

/** Where a body's nearest surface is on the screen: the middle of what is drawn of it. */
const onScreen = (page, body) => page.evaluate((body) => {
  const app = globalThis.limber, { stage } = app, canvas = stage.renderer.domElement.getBoundingClientRect();
  const positions = app.engine.reconstruct(body), p = stage.controls.target.clone();
  stage.camera.updateMatrixWorld();
  const corners = stage.bodies[body].mesh.geometry.index.array, corner = p.clone();
  for (let t = 0; t < corners.length; t += 3) {  // the middle of a triangle that nothing hides
    p.set(0, 0, 0);
    for (let i = 0; i < 3; ++i) p.addScaledVector(corner.fromArray(positions, 3 * corners[t + i]), 1 / 3);
    p.project(stage.camera);
    const at = { clientX: Math.round(canvas.left + (p.x + 1) * 0.5 * canvas.width), clientY: Math.round(canvas.top + (1 - p.y) * 0.5 * canvas.height) };
    const { from, along } = stage.ray(at), hit = app.engine.cast(from, along);
    if (hit?.body === body && document.elementFromPoint(at.clientX, at.clientY) === stage.renderer.domElement) return [at.clientX, at.clientY];
  }
  return null;
}, body);
const hash = (page) => page.evaluate(() => globalThis.limber.engine.hash());
const steps = (page, count) => page.evaluate((count) => {
  const app = globalThis.limber, hashes = [];
  for (let i = 0; i < count; ++i) app.step(), hashes.push(app.engine.hash());
  app.show();
  return hashes;
}, count);
const place = (page, body) => page.evaluate((body) => {
  const app = globalThis.limber, first = app.engine.sizes.slice(0, body).reduce((sum, size) => sum + size, 0);
  return [...app.engine.frame().slice(first, first + 3)];
}, body);
const distance = (a, b) => Math.hypot(...a.map((x, i) => x - b[i]));

async function playsByItself(page) {
  check(await page.evaluate(() => globalThis.limber !== undefined), `it opens: "${await page.evaluate(() => document.getElementById('message').textContent)}"`);
  const taken = () => page.evaluate(() => globalThis.limber.engine.steps()), before = await taken();
  check(await until(async () => (await taken()) > before), 'it goes on by itself');
  await isSafe(page, file);
  check((await page.locator('#panel button:text-is("Sound")').count()) === 0, 'a scene that one cannot hear has no button for it');
}

/** As it begins, at rest: whatever number of steps it has played. */
const fromTheStart = (page) => page.evaluate(() => {
  globalThis.limber.restart();
  globalThis.limber.setPlaying(false);
});

async function isDragged(page) {
  await fromTheStart(page);
  const at = await onScreen(page, 0), start = await place(page, 0);
  check(at !== null, 'a body is seen');
  if (at === null) return;
  await page.mouse.move(...at);
  await page.mouse.down();
  check(await page.evaluate(() => globalThis.limber.engine.hand().holds), 'a press on a body takes hold of it');
  await page.mouse.move(at[0] - 60, at[1] - 90, { steps: 4 });
  await steps(page, 60);
  const force = await page.evaluate(() => Math.hypot(...globalThis.limber.engine.hand().force));
  check(force > 0 && (await page.evaluate(() => document.getElementById('panel').textContent)).includes('hand pulls'), 'its force is told');
  const size = await page.evaluate(() => globalThis.limber.stage.size);
  check(distance(await place(page, 0), start) > 0.02 * size, 'it follows');
  await page.mouse.up();
  check(!(await page.evaluate(() => globalThis.limber.engine.hand().holds)), 'it is let go');
}

async function isSaved(page) {
  const before = await hash(page);
  const [file] = await Promise.all([page.waitForEvent('download'), page.locator('#panel button:has-text("Save GLB")').click()]);
  const bytes = readFileSync(await file.path());
  check(bytes.subarray(0, 4).toString() === 'glTF' && bytes.readUInt32LE(8) === bytes.length, 'what happened is saved as a GLB');
  check((await hash(page)) === before, 'saving changes nothing');
}

/** A page that was shared goes on from where the other stood, in its own file, seen from the same side. */
async function isShared(page) {
  await fromTheStart(page);
  await steps(page, 30);
  await page.evaluate(() => globalThis.limber.drop(0));
  const look = (page) => page.evaluate(() => {
    const { camera, controls } = globalThis.limber.stage;
    return { eye: camera.position.toArray(), target: controls.target.toArray(), bodies: globalThis.limber.engine.scene.bodies.length };
  });
  await steps(page, 5);
  const before = await hash(page), seen = await look(page);
  const [download] = await Promise.all([page.waitForEvent('download'), page.locator('#panel button:has-text("Share")').click()]);
  const shared = join(folder, 'shared.html');
  await download.saveAs(shared);
  const other = await open(shared), there = await look(other);
  check((await hash(other)) === before, 'a shared page stands as the other stood');
  check(there.bodies === seen.bodies && distance(there.eye, seen.eye) < 1e-9 && distance(there.target, seen.target) < 1e-9, 'seen from the same side, with what was dropped');
  check(!(await other.evaluate(() => globalThis.limber.playing)), 'it waits as the other did');
  const next = await steps(page, 10), following = await steps(other, 10);
  check(next.every((value, i) => value === following[i]), 'the same follows');
  await other.close();
}

async function goesBack(page) {
  await fromTheStart(page);
  const first = await steps(page, 25), start = await hash(page);
  check(new Set(first).size === first.length, 'every step changes the state');
  const input = page.locator('#panel label:has-text("Time") input');
  const last = Number(await input.getAttribute('max'));
  await input.evaluate((slider) => { slider.value = slider.max - 15; slider.dispatchEvent(new Event('input')); });
  const steppedBack = await page.evaluate(() => globalThis.limber.engine.steps());
  check(steppedBack === (await page.evaluate((key) => globalThis.limber.engine.keptStep(key), last - 15)), 'scrubbing goes back');
  check((await hash(page)) === first[first.length - 16], 'the state there is what it was');
  const again = await steps(page, 15);
  check(again.every((value, i) => value === first[first.length - 15 + i]) && (await hash(page)) === start, 'the same steps follow');
  await page.evaluate(() => globalThis.limber.drop(0));
  const dropped = await steps(page, 3), count = await page.evaluate(() => globalThis.limber.engine.scene.bodies.length);
  await page.evaluate((key) => globalThis.limber.goTo(key), last);
  check((await page.evaluate(() => globalThis.limber.stage.bodies.length)) === count - 1, 'a body dropped since is gone');
  await page.evaluate(() => globalThis.limber.goTo(globalThis.limber.engine.kept() - 1));
  check((await hash(page)) === dropped[2], 'and there again later');
}

/** Outlines of what the GPU bends and of what World::reconstruct() gives. @return pixels drawn, and farther off than one */
const outlines = (page, body) => page.evaluate((body) => {
  const app = globalThis.limber, { stage } = app, seen = stage.bodies[body].mesh, gl = stage.renderer.getContext();
  const hidden = [stage.still, stage.sensors, stage.joints, stage.hand, stage.rays, ...stage.bodies.map((b) => b.mesh)].filter((x) => x !== seen);
  for (const x of hidden) x.visible = false;
  const background = stage.scene.background, shown = seen.material;
  stage.scene.background = background.clone().set(0xff00ff);
  const width = gl.drawingBufferWidth, height = gl.drawingBufferHeight;
  const drawn = () => {
    stage.renderer.shadowMap.enabled = false;
    stage.renderer.render(stage.scene, stage.camera);
    const pixels = new Uint8Array(4 * width * height);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
    const off = (i) => 255 - pixels[4 * i] + pixels[4 * i + 1] + 255 - pixels[4 * i + 2];
    return Uint8Array.from({ length: width * height }, (_, i) => (off(i) > 150 ? 1 : 0));
  };
  const bent = drawn();
  const Mesh = seen.constructor, Geometry = seen.geometry.constructor, Attribute = seen.geometry.attributes.position.constructor;
  const geometry = new Geometry();
  geometry.setAttribute('position', new Attribute(app.engine.reconstruct(body), 3));
  geometry.setIndex(seen.geometry.index);
  geometry.computeVertexNormals();
  const material = new shown.constructor({ side: shown.side }), other = new Mesh(geometry, material);
  other.frustumCulled = false;
  stage.scene.add(other);
  seen.visible = false;
  const reconstructed = drawn();
  stage.scene.remove(other);
  for (const x of [seen, ...hidden]) x.visible = true;
  stage.scene.background = background;
  stage.renderer.shadowMap.enabled = true;
  const near = (mask, x, y) => {
    for (let j = Math.max(0, y - 1); j <= Math.min(height - 1, y + 1); ++j)
      for (let i = Math.max(0, x - 1); i <= Math.min(width - 1, x + 1); ++i) if (mask[j * width + i]) return true;
    return false;
  };
  let count = 0, off = 0;
  for (let y = 0; y < height; ++y)
    for (let x = 0; x < width; ++x) {
      count += reconstructed[y * width + x];
      if ((bent[y * width + x] && !near(reconstructed, x, y)) || (reconstructed[y * width + x] && !near(bent, x, y))) ++off;
    }
  return { count, off, bent: bent.reduce((sum, x, i) => (x ? (31 * sum + i) % 1000003 : sum), 7), share: count / bent.length };
}, body);

async function showsWhatTheEngineHas(page) {
  await page.evaluate(() => globalThis.limber.showMode(0, 0, 0));
  const atRest = await outlines(page, 0);
  for (const mode of [0, 1]) {
    await page.evaluate((mode) => globalThis.limber.showMode(0, mode, -1), mode);
    const seen = await outlines(page, 0);
    check(seen.count > 500 && seen.share < 0.9, `mode ${mode}: the body is drawn, ${seen.count} pixels`);
    check(seen.off === 0, `mode ${mode}: the picture is the engine's surface within a pixel, ${seen.off} are off`);
    check(seen.bent !== atRest.bent, `mode ${mode}: it is seen to bend`);
  }
}

/** Sensors stand as outlines whose colour tells whether somebody is inside. */
async function drawsSensors(page) {
  const look = () => page.evaluate(() => {
    const { stage, engine } = globalThis.limber;
    return { names: engine.scene.sensors.map((s) => s.name), counts: engine.sensorCounts(),
      drawn: stage.sensors.children.map((c) => ({ line: c.isLineSegments, ends: c.geometry.attributes.position.count, color: c.material.color.getHex() })) };
  });
  await fromTheStart(page);
  const { names, drawn } = await look();
  check(drawn.length === names.length && drawn.every((d) => d.line), 'each sensor has its outline');
  if (names.length === 0) return;
  check(drawn[0].ends === 24, `a box has twelve edges, ${drawn[0].ends / 2} are drawn`);
  await steps(page, 90);
  const later = await look();
  check(later.counts[0] > later.counts[1] && later.counts[1] === 0, `bodies fall into the first alone: ${later.counts}`);
  check(later.drawn[0].color !== later.drawn[1].color && later.drawn[1].color === drawn[1].color, 'it is seen');
}

/** The tool Ray draws what a ray through the pointer meets, and tells it. */
async function drawsARay(page) {
  await fromTheStart(page);
  const at = await onScreen(page, 0);
  await page.locator('#panel button:has-text("Ray")').click();
  await page.mouse.click(...at);
  const seen = () => page.evaluate(() => {
    const { stage, ray } = globalThis.limber;
    return { places: ray?.places ?? [], ends: [...stage.rays.geometry.attributes.position.array], visible: stage.rays.visible };
  });
  const { places, ends, visible } = await seen();
  check(places.length > 0 && places[0].body === 0, 'a ray through the pointer meets the body there');
  check(visible && ends.length === 6 * (1 + places.length), 'it is drawn, with a normal at each place');
  check(distance(ends.slice(3, 6), places.at(-1).point) < 1e-3, 'as far as the last of them');
  check(!(await page.evaluate(() => globalThis.limber.engine.hand().holds)), 'and nothing is held');
  check((await page.evaluate(() => document.getElementById('panel').textContent)).includes('the ray meets'), 'places are told');
  await page.locator('#panel button:has-text("Drag")').click();
  await page.evaluate(() => globalThis.limber.show());
  check(!(await seen()).visible, 'another tool takes it away');
}

/** A pointer over a body shows that a press would take hold of it. */
async function showsWhatCanBeHeld(page) {
  await fromTheStart(page);
  const at = await onScreen(page, 0), cursor = () => page.evaluate(() => globalThis.limber.stage.renderer.domElement.style.cursor);
  await page.mouse.move(...at);
  check(await until(async () => (await cursor()) === 'grab'), 'a pointer over a body is told');
  await page.mouse.down();
  check((await cursor()) === 'grabbing', 'so is a body that is held');
  await page.mouse.up();
  await page.mouse.move(3, 3);
  check(await until(async () => (await cursor()) === ''), 'nothing is told beside it');
}

/** The ground is seen from above only. */
async function looksThroughTheGround(page) {
  const seen = await page.evaluate(() => {
    const { stage } = globalThis.limber, up = stage.camera.up.clone(), along = up.clone().negate();
    const grounds = globalThis.limber.engine.scene.statics.flatMap(({ ground }, i) => (ground ? [stage.still.children[i]] : []));
    return grounds.map((mesh) => {
      const meets = (from, way) => (stage.caster.set(from, way), stage.caster.intersectObject(mesh).length > 0);
      const beside = mesh.geometry.attributes.position, middle = up.clone().set(0.1, 0.2, 0), height = beside.getZ(0);
      return { above: meets(middle.clone().setZ(height + 1), along), below: meets(middle.clone().setZ(height - 1), up) };
    });
  });
  check(seen.length > 0 && seen.every(({ above, below }) => above && !below), `the ground hides nothing from below: ${JSON.stringify(seen)}`);
}

/** The camera goes with a body, and comes back. */
async function follows(page) {
  await fromTheStart(page);
  const view = () => page.evaluate(() => globalThis.limber.stage.controls.target.toArray());
  await page.locator('#panel button:has-text("See all")').click();
  const first = await view();
  await page.locator('#panel button:has-text("Follow")').click();
  await page.mouse.click(...(await onScreen(page, 0)));
  const from = await place(page, 0);
  await steps(page, 15);
  const to = await place(page, 0), seen = await view();
  check(distance(from, to) > 0, 'the body moves');
  check(distance(seen.map((x, i) => x - first[i]), to.map((x, i) => x - from[i])) < 1e-5, 'the view goes as far as the body');
  await fromTheStart(page);
  await page.keyboard.press('Home');
  check(distance(await view(), first) < 1e-5, 'and sees all again');
  await page.locator('#panel button:has-text("Drag")').click();
}

/** Steps that take long do not heap up in a frame. */
async function answersWhileStepsAreSlow(page) {
  await fromTheStart(page);
  const taken = (milliseconds) => page.evaluate((milliseconds) => {
    const app = globalThis.limber, step = app.step;
    let count = 0;
    app.step = () => {
      ++count;
      for (const began = performance.now(); performance.now() - began < milliseconds;) continue;
    };
    app.playing = true;
    app.frame(1);
    app.step = step;
    app.setPlaying(false);
    return count;
  }, milliseconds);
  check((await taken(150)) === 1, 'a slow step is the only one of its frame');
  check((await taken(0)) > 1, 'quick steps catch up');
}

/** A page's address may ask for a pause. */
async function waitsWhereAsked() {
  const page = await open(file, undefined, '#paused');
  check(await page.evaluate(() => !globalThis.limber.playing && globalThis.limber.engine.steps() === 0), 'it begins with a pause');
  await page.keyboard.press(' ');
  check(await until(() => page.evaluate(() => globalThis.limber.engine.steps() > 0)), 'and goes on');
  await page.close();
}

/** The page knows of another size with the next frame that it draws, and not before: a frame may take long. */
async function resized(page, size) {
  await page.setViewportSize(size);
  await page.evaluate(() => new Promise((drawn) => requestAnimationFrame(() => requestAnimationFrame(drawn))));
}

/** On a phone: folded sheets below the picture, controls for fingers, nothing cut off. */
async function fitsAPhone(page) {
  const size = page.viewportSize(), folded = picture?.replace('.png', '.phone.png'), unfolded = picture?.replace('.png', '.phone_controls.png');
  await fromTheStart(page);
  await resized(page, { width: 400, height: 800 });
  await page.keyboard.press('Home');
  const look = () => page.evaluate(() => {
    const panel = document.getElementById('panel'), seen = (x) => x.getClientRects().length > 0;
    const all = [...panel.querySelectorAll('*')].filter(seen), box = panel.getBoundingClientRect();
    const small = all.filter((x) => x.tagName === 'BUTTON').map((x) => [x.textContent, x.getBoundingClientRect()])
      .filter(([, { width, height }]) => width < 44 || height < 44).map(([text]) => text);
    const cut = all.filter((x) => x.getBoundingClientRect().right > innerWidth + 0.5 || x.scrollWidth > x.clientWidth + 1 && x.clientWidth > 0)
      .map((x) => `${x.tagName} ${x.textContent.slice(0, 20)}`);
    return { height: box.height, small, cut };
  });
  const closed = await look();
  check(closed.height < 80, `the panel is folded, ${closed.height} pixels high`);
  check((await onScreen(page, 0)) !== null, 'a body is seen on a phone');
  if (folded) await page.screenshot({ path: folded });
  for (const title of ['Details', 'Controls']) {
    await page.locator(`#panel nav button:has-text("${title}")`).click();
    const { height, small, cut } = await look();
    check(height > closed.height && height < 0.6 * 800, `${title} unfolds, ${height} pixels high`);
    check(small.length === 0, `buttons are of 44 pixels: ${small}`);
    check(cut.length === 0, `nothing is cut off: ${cut}`);
    check((await page.locator('#panel .sheet:visible').count()) === 1, 'one sheet at a time');
  }
  if (unfolded) await page.screenshot({ path: unfolded });
  await resized(page, size);
}

/** A download that broke off says so. */
async function tellsOfABrokenDownload() {
  const text = readFileSync(file, 'utf8'), half = join(folder, 'half.html');
  writeFileSync(half, text.slice(0, text.length / 2));
  const page = await open(half, (half) => half.locator('#loading').isVisible());
  check((await page.locator('#loading').textContent()).includes('not complete'), 'half a page says that it is not complete');
  await page.close();
}

async function tellsOfDamage() {
  const text = readFileSync(file, 'utf8'), begin = text.indexOf('<script type="application/json" id="files">');
  const asset = text.indexOf('"packed":"', begin) + 10;
  const damaged = join(folder, 'damaged.html');
  writeFileSync(damaged, text.slice(0, asset + 400) + (text[asset + 400] === 'A' ? 'B' : 'A') + text.slice(asset + 401));
  const page = await open(damaged);
  const message = page.locator('#message.error');
  check((await message.count()) === 1, 'a damaged asset is told');
  const line = (await message.count()) === 1 ? await message.textContent() : '';
  check(line.length > 10 && !line.includes('\n'), `in one line: "${line}"`);
  await page.close();
}

/** A finger takes hold of a body too; two of them turn the view, not the body. */
async function isTouched(page) {
  await page.evaluate(() => globalThis.limber.setPlaying(false));
  const at = await onScreen(page, 0), session = await page.context().newCDPSession(page);
  const touch = (type, ...points) => session.send('Input.dispatchTouchEvent', { type, touchPoints: points.map(([x, y], id) => ({ x, y, id })) });
  await touch('touchStart', at);
  check(await page.evaluate(() => globalThis.limber.engine.hand().holds), 'a finger takes hold of a body');
  await touch('touchMove', [at[0] - 40, at[1] - 40]);
  check((await page.evaluate(() => Math.hypot(...globalThis.limber.engine.hand().target.map((x, i) => x - globalThis.limber.engine.hand().point[i])))) > 0, 'it leads it');
  await touch('touchEnd');
  check(!(await page.evaluate(() => globalThis.limber.engine.hand().holds)), 'and lets it go');
}

/**
 * What a step's stages take stands in the panel and sums to the step. The browser's clock goes on by tenths of a millisecond, so
 * that all stages of one step may be nothing: they are summed over as many steps as take half a second by the same clock.
 */
async function tellsTheStages(page) {
  await fromTheStart(page);
  const { passed, stages } = await page.evaluate(() => {
    const { limber } = globalThis, stages = Array(8).fill(0);
    let passed = 0;
    while (passed < 500) {
      const began = performance.now();
      limber.step();
      passed += performance.now() - began;
      limber.engine.stages().forEach((seconds, i) => { stages[i] += 1000 * seconds; });
    }
    return { passed, stages };
  });
  const sum = stages.reduce((a, b) => a + b, 0), told = `${stages.map((x) => x.toFixed(2))} sum to ${sum.toFixed(2)} of ${passed.toFixed(2)} ms`;
  check(stages.every((x) => x >= 0), `no stage takes less than nothing: ${told}`);
  check(sum > 0.3 * passed && sum < 1.01 * passed, `stages make up a step, but for what the page itself does in it: ${told}`);
  check((await page.evaluate(() => document.getElementById('panel').textContent)).includes('joints solved'), 'stages are named');
  const [all, ...parts] = await page.evaluate(() => globalThis.limber.panel.time.rows.at(-1));
  check(all > 0 && Math.abs(all - parts.reduce((a, b) => a + b, 0)) < 1e-9 * all, `parts of the chart sum to the step: ${parts} to ${all}`);
}

await run('check_page', file, async () => {
  const page = await open(file);
  await playsByItself(page);
  if (wrong.length === 0) {
    await isDragged(page);
    if (whole) {
      await isTouched(page);
      await tellsTheStages(page);
    }
    await goesBack(page);
    await isSaved(page);
    await isShared(page);
    if (picture !== undefined) {
      await fromTheStart(page);
      await steps(page, 60);
      await page.screenshot({ path: picture });
    }
    if (whole) {
      await drawsSensors(page);
      await drawsARay(page);
    }
    await showsWhatTheEngineHas(page);
    if (whole) await showsWhatCanBeHeld(page);
    await looksThroughTheGround(page);
    await follows(page);
    if (whole) {
      await answersWhileStepsAreSlow(page);
      await fitsAPhone(page);
    }
    check((await page.evaluate(() => document.querySelectorAll('img, iframe, object, embed').length)) === 0, 'no text has become markup');
  }
  await page.close();
  if (whole) {
    await waitsWhereAsked();
    await tellsOfDamage();
    await tellsOfABrokenDownload();
  }
});
