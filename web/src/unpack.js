// Reads what weathercoat/output/viewer/arrays.py packs.

const TYPES = { 1: Uint8Array, 2: Uint16Array, 4: Uint32Array };

/** The bytes of base64 text. */
function fromBase64(text) {
  if (Uint8Array.fromBase64) return Uint8Array.fromBase64(text);
  const binary = atob(text);
  const bytes = new Uint8Array(binary.length);
  for (let i = 0; i < bytes.length; i++) bytes[i] = binary.charCodeAt(i);
  return bytes;
}

/** The arrays of a chunk by name; `layout` is its list of [name, bytes of a value, values, distance]. */
export async function unpackChunk(text, layout) {
  const stream = new Blob([fromBase64(text)]).stream().pipeThrough(new DecompressionStream("deflate"));
  const content = new Uint8Array(await new Response(stream).arrayBuffer());
  const arrays = {};
  let start = 0;
  for (const [name, width, count, distance] of layout) {
    const values = new TYPES[width](count);
    for (let plane = 0; plane < width; plane++) {
      const from = start + plane * count;
      for (let i = 0; i < count; i++) values[i] |= content[from + i] << (8 * plane);
    }
    if (distance) for (let i = distance; i < count; i++) values[i] += values[i - distance];
    arrays[name] = values;
    start += width * count;
  }
  return arrays;
}

/** Points of a grid {low, spacing} as floats. */
export function fromGrid(values, { low, spacing }) {
  const points = new Float32Array(values.length);
  for (let i = 0; i < values.length; i++) points[i] = low[i % 3] + spacing * values[i];
  return points;
}

/** The film of a snapshot: faces, the metal's vertex that each vertex stems from, and places on the grid. */
export function unpackFilm(metal, arrays) {
  const { present, copies, rank, shift } = arrays;
  const first = new Uint32Array(copies.length + 1);
  for (let i = 0; i < copies.length; i++) first[i + 1] = first[i] + copies[i];
  const count = first[copies.length];
  const origin = new Uint32Array(count);
  for (let i = 0; i < copies.length; i++) origin.fill(i, first[i], first[i + 1]);
  const faces = new Uint32Array(rank.length);
  for (let face = 0, corner = 0; face < present.length; face++) {
    if (!present[face]) continue;
    for (let i = 3 * face; i < 3 * face + 3; i++, corner++) faces[corner] = first[metal.faces[i]] + rank[corner];
  }
  const places = new Uint16Array(3 * count);
  for (let i = 0; i < 3 * count; i++) places[i] = metal.rest[3 * origin[(i / 3) | 0] + (i % 3)] + shift[i];
  return { faces, origin, places, count };
}
