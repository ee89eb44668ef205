// Files of a page, as page_with() puts them in (view/src/page_file.cpp).
export function bytesOf(base64) {
  const text = atob(base64.trim()), bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; ++i) bytes[i] = text.charCodeAt(i);
  return bytes;
}

export function base64Of(bytes) {
  let text = '';
  for (let i = 0; i < bytes.length; i += 32768) text += String.fromCharCode(...bytes.subarray(i, i + 32768));
  return btoa(text);
}

/** gzip's way back. */
export async function unzipped(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream('gzip'));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** The bytes of a file {base64}, {gzip} or {packed}. */
export async function fileOf({ base64, gzip, packed }) {
  if (base64 !== undefined) return bytesOf(base64);
  if (gzip !== undefined) return unzipped(bytesOf(gzip));
  return unpacked(await unzipped(bytesOf(packed)));
}

/** packed()'s way back (view/src/packed_asset.h). */
function unpacked(bytes) {
  const view = new DataView(bytes.buffer), heads = Array.from({ length: view.getUint32(4, true) }, (_, i) => ({
    kind: view.getUint32(8 + 12 * i, true), size: view.getUint32(12 + 12 * i, true), exponent: view.getInt32(16 + 12 * i, true) }));
  const out = new Uint8Array(heads.reduce((sum, { size }) => sum + size, 0));
  let from = 8 + 12 * heads.length, to = 0;
  for (const { kind, size, exponent } of heads) {
    const count = size / 4;
    if (kind === 0) out.set(bytes.subarray(from, from + size), to);
    if (kind === 1) out.set(new Uint8Array(summed(bytes, from, count, 4).buffer), to);
    if (kind === 2) out.set(new Uint8Array(Float32Array.from(new Int16Array(summed(bytes, from, count, 2).buffer), (q) => q * 2 ** exponent).buffer), to);
    from += kind === 2 ? 2 * count : size;
    to += size;
  }
  return out;
}

/** Whole numbers, each told less the third before it, lowest bytes of all first. */
function summed(bytes, from, count, width) {
  const out = width === 4 ? new Uint32Array(count) : new Uint16Array(count);
  for (let byte = 0; byte < width; ++byte)
    for (let i = 0; i < count; ++i) out[i] |= bytes[from + byte * count + i] << (8 * byte);
  for (let i = 3; i < count; ++i) out[i] += out[i - 3];
  return out;
}
