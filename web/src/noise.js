// Gradient noise in a volume that repeats: value and slope, so that the shader reads fractal noise in a few fetches.
import { Data3DTexture, LinearFilter, LinearMipmapLinearFilter, RGBAFormat, RepeatWrapping } from "three";

export const CELLS = 16; // after which the noise repeats
const TEXELS = 4; // a cell

/** Fixed bits for a lattice point (murmur3's finaliser). */
function hash(i, j, k) {
  let h = Math.imul(i, 0x8da6b343) ^ Math.imul(j, 0xd8163841) ^ Math.imul(k, 0xcb1ab31f);
  h = Math.imul(h ^ (h >>> 16), 0x85ebca6b);
  h = Math.imul(h ^ (h >>> 13), 0xc2b2ae35);
  return (h ^ (h >>> 16)) >>> 0;
}

/** A texture of slopes, 0.5 + slope / 8, in red, green and blue and the value, 0 to 1, in alpha. */
export function makeNoise() {
  const side = CELLS * TEXELS;
  const gradients = new Float32Array(3 * CELLS ** 3);
  for (let n = 0, k = 0; k < CELLS; k++) {
    for (let j = 0; j < CELLS; j++) {
      for (let i = 0; i < CELLS; i++, n += 3) {
        const bits = hash(i, j, k);
        for (let axis = 0; axis < 3; axis++) gradients[n + axis] = ((bits >>> (10 * axis)) & 1023) / 511.5 - 1;
      }
    }
  }
  const weights = Array.from({ length: TEXELS }, (_, i) => {
    const u = (i + 0.5) / TEXELS;
    const fade = u * u * u * (u * (u * 6 - 15) + 10);
    const slope = 30 * u * u * (u * (u - 2) + 1);
    return [
      [1 - fade, -slope, u],
      [fade, slope, u - 1],
    ];
  });
  const bytes = new Uint8Array(4 * side ** 3);
  const byte = (x) => Math.max(0, Math.min(255, Math.round(255 * x)));
  for (let at = 0, z = 0; z < side; z++) {
    for (let y = 0; y < side; y++) {
      for (let x = 0; x < side; x++, at += 4) {
        let [value, sx, sy, sz] = [0, 0, 0, 0];
        for (let corner = 0; corner < 8; corner++) {
          const [a, b, c] = [corner & 1, (corner >> 1) & 1, corner >> 2];
          const i = (((x / TEXELS) | 0) + a) % CELLS;
          const j = (((y / TEXELS) | 0) + b) % CELLS;
          const k = (((z / TEXELS) | 0) + c) % CELLS;
          const g = 3 * (i + CELLS * (j + CELLS * k));
          const [wx, dx, u] = weights[x % TEXELS][a];
          const [wy, dy, v] = weights[y % TEXELS][b];
          const [wz, dz, w] = weights[z % TEXELS][c];
          const rise = gradients[g] * u + gradients[g + 1] * v + gradients[g + 2] * w;
          value += wx * wy * wz * rise;
          sx += wx * wy * wz * gradients[g] + dx * wy * wz * rise;
          sy += wx * wy * wz * gradients[g + 1] + wx * dy * wz * rise;
          sz += wx * wy * wz * gradients[g + 2] + wx * wy * dz * rise;
        }
        bytes[at] = byte(0.5 + (0.9 * sx) / 8);
        bytes[at + 1] = byte(0.5 + (0.9 * sy) / 8);
        bytes[at + 2] = byte(0.5 + (0.9 * sz) / 8);
        bytes[at + 3] = byte(0.5 + 0.9 * value);
      }
    }
  }
  const texture = new Data3DTexture(bytes, side, side, side);
  texture.format = RGBAFormat;
  texture.wrapS = texture.wrapT = texture.wrapR = RepeatWrapping;
  texture.magFilter = LinearFilter;
  texture.minFilter = LinearMipmapLinearFilter;
  texture.generateMipmaps = true;
  texture.needsUpdate = true;
  return texture;
}
