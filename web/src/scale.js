// Overlays: which scalar each shows, and its scale of colours.
import { DataTexture, LinearFilter, SRGBColorSpace } from "three";

// ColorBrewer's YlOrBr and RdBu (Apache 2), matplotlib's viridis and inferno (CC0).
const YLORBR = "ffffe5 fff7bc fee391 fec44f fe9929 ec7014 cc4c02 993404 662506";
const BROWNS = "f4f1ea e6dccb d3c1a5 bba380 9f845f 836745 684d30 4c361f 2f2011";
const VIRIDIS = "440154 472d7b 3b528b 2c728e 21918c 28ae80 5ec962 addc30 fde725";
const INFERNO = "000004 1b0c41 4a0c6b 781c6d a52c60 cf4446 ed6925 fb9b06 f7d13d fcffa4";
const BURD = "2166ac 4393c3 92c5de d1e5f0 f7f7f7 fddbc7 f4a582 d6604d b2182b";

/** `state` and `figures` pick a component of the vertex attributes, `film` is the array that holds the film's. */
export const OVERLAYS = {
  rust: { label: "Rust", film: "stain", metal: "rust", state: 0, colors: YLORBR, note: "of the metal; on the film, rust that ran over it" },
  dirt: { label: "Dirt", film: "dirt", metal: "dirt", state: 1, colors: BROWNS, note: "dust that has settled" },
  adhesion: { label: "Adhesion", film: "adhesion", figures: 0, colors: VIRIDIS, note: "what still holds the film" },
  strain: { label: "Strain", film: "strain", figures: 1, colors: BURD, note: "length of the film's edges against rest" },
  risk: { label: "Risk", film: "risk", figures: 2, colors: INFERNO, note: "lift over adhesion: 1 lets go" },
};

function stops(colors) {
  return colors.split(" ").map((hex) => [0, 2, 4].map((at) => parseInt(hex.slice(at, at + 2), 16)));
}

/** The scale as a row of 256 texels. */
export function makeScale(colors) {
  const all = stops(colors);
  const bytes = new Uint8Array(4 * 256);
  for (let i = 0; i < 256; i++) {
    const at = (i / 255) * (all.length - 1);
    const low = Math.min(all.length - 2, Math.floor(at));
    for (let c = 0; c < 3; c++) bytes[4 * i + c] = Math.round(all[low][c] + (at - low) * (all[low + 1][c] - all[low][c]));
    bytes[4 * i + 3] = 255;
  }
  const texture = new DataTexture(bytes, 256, 1);
  texture.colorSpace = SRGBColorSpace;
  texture.magFilter = texture.minFilter = LinearFilter;
  texture.needsUpdate = true;
  return texture;
}

/** The scale as a gradient of CSS. */
export function gradient(colors) {
  return `linear-gradient(to right, ${colors.split(" ").map((hex) => `#${hex}`).join(", ")})`;
}
