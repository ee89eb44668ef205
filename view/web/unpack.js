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
    const packed = bytes.subarray(from, from + (kind === 2 ? size / 2 : size));
    const part = kind === 0 ? packed : kind === 1 ? words(packed) : halves(packed, 2 ** exponent);
    out.set(new Uint8Array(part.buffer, part.byteOffset, size), to);
    from += packed.length;
    to += size;
  }
  return out;
}

// Whole numbers, each told less the third before it, lowest bytes of all first.
function words(packed) {
  const count = packed.length / 4, out = new Uint32Array(count);
  for (let i = 0; i < count; ++i) {
    const before = i < 3 ? 0 : out[i - 3];
    out[i] = before + (packed[i] | packed[count + i] << 8 | packed[2 * count + i] << 16 | packed[3 * count + i] << 24);
  }
  return out;
}
function halves(packed, scale) {
  const count = packed.length / 2, sums = new Int16Array(count), out = new Float32Array(count);
  for (let i = 0; i < count; ++i) {
    sums[i] = (i < 3 ? 0 : sums[i - 3]) + (packed[i] | packed[count + i] << 8);
    out[i] = sums[i] * scale;
  }
  return out;
}
