// Two bars end to end along x, the second hinged to the first about y, are pulled up: in Node and in a browser.
function bars() {
  const text = [], quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
  for (const x of [0, 1.02])
    for (let i = 0; i < 8; ++i) text.push(`v ${x + (i & 1)} ${0.2 * (i >> 1 & 1)} ${0.2 * (i >> 2)}`);
  for (const first of [1, 9])
    for (const quad of quads) text.push(`f ${quad.map((v) => first + v).join(' ')}`);
  return `${text.join('\n')}\n`;
}
const joints = JSON.stringify({
  components: [{ name: 'base', faces: [[0, 6]] }, { name: 'arm', faces: [[6, 6]] }],
  joints: [{ a: 0, b: 1, type: 'revolute', origin: [1.01, 0.1, 0.1], axis: [0, 1, 0], limits: { rotation: [-1, 1] } }],
});
export const open = (Posing) => Posing.open({ 'bars.obj': bars(), 'bars.json': joints }, 'bars.obj', 'bars.json');

/** Pulls the tip of the arm. @return the pose found, of which all numbers count */
export async function pull({ load, Posing }) {
  await load();
  const posing = await open(Posing);
  const { part } = posing.cast([1.97, 0.1, 5], [0, 0, -1]);
  posing.grab();
  posing.dragTo([1.9, 0.1, 0.7]);
  let found;
  do found = posing.solve(); while (found.status === 'going on');
  return { part, found, turn: posing.jointFrames()[6], handles: posing.handles(), positions: [...posing.positions()] };
}
