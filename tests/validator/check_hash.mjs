// Computes the content hash of assets from what docs/formats/asset.md says, by other means than limber:
//   node check_hash.mjs FILE…
import assert from 'node:assert/strict';
import { createHash } from 'node:crypto';
import { readFile } from 'node:fs/promises';

function contentHash(document, binary) {
  const hash = createHash('sha256');
  const u64 = (n) => hash.update(new BigUint64Array([BigInt(n)]));
  const f64 = (numbers) => hash.update(new Float64Array([numbers].flat()));
  const text = (s) => (u64(Buffer.byteLength(s)), hash.update(s));
  const optional = (part, ...counts) => (part ? [1, ...counts.map((key) => part[key])] : [0]).forEach(u64);

  const { provenance } = document.extensions.LIMBER_modal;
  hash.update('LIMBER_modal 1\n');
  [provenance.tool, provenance.input, provenance.input_hash, provenance.options].forEach(text);
  u64(document.meshes.length);
  for (const { name, extensions: { LIMBER_modal: body } } of document.meshes) {
    [name, body.motion].forEach(text);
    if (body.motion === 'line') f64(body.line_axis);
    for (const key of ['mass', 'volume', 'center_of_mass', 'origin_in_input', 'inertia']) f64(body[key]);
    u64(body.modes);
    for (const key of ['eigenvalues', 'decays', 'participation', 'moments', 'mode_scales']) f64(body[key]);
    [body.vertices, body.triangles].forEach(u64);
    optional(body.collision, 'vertices', 'triangles');
    optional(body.volume_block, 'nodes', 'tets');
    if (body.residual_compliance) text(body.residual_compliance.form), u64(body.residual_compliance.vertices);
    if (body.captured) {
      text('captured'), u64(body.captured.loads);
      for (let i = 0; i < body.captured.loads; ++i) f64(body.captured.places.slice(3 * i, 3 * i + 3)), f64(body.captured.shares[i]);
    }
    if (body.frequency_errors) text('frequency_errors'), f64(body.frequency_errors.map((e) => e ?? NaN));
    if (body.skin) text('skin'), [body.skin.version, body.skin.handles].forEach(u64);
    if (body.sound) {
      const { version, modes, vertices, contact_modulus = Infinity, eigenvalues, decays } = body.sound;
      text('sound'), [version, modes, vertices].forEach(u64), f64(contact_modulus), f64(eigenvalues), f64(decays);
    }
  }
  return `sha256:${hash.update(binary).digest('hex')}`;
}

for (const file of process.argv.slice(2)) {
  const bytes = await readFile(file);
  const jsonLength = bytes.readUInt32LE(12);
  const document = JSON.parse(bytes.subarray(20, 20 + jsonLength).toString('utf8'));
  const binary = bytes.subarray(28 + jsonLength);
  assert.equal(contentHash(document, binary), document.extensions.LIMBER_modal.content_hash, file);
  console.log(`${file}: the content hash is as documented`);
}
