// Paint, primer, steel and rust: as weathercoat/output/shading.py makes them, in a standard material of three.js.
import { Color, DoubleSide, MeshStandardMaterial, Vector3, Vector4 } from "three";
import { CELLS } from "./noise.js";

/** What a vertex belongs to: the attribute `kind`. */
export const KIND = { front: 0, back: 1, rim: 2, metal: 3, untouched: 4 };

const VERTEX_HEAD = /* glsl */ `
attribute vec3 rest;
attribute vec4 state; // stain or rust, dirt, rust of the metal, layer
attribute vec4 figures; // adhesion, strain, risk, openness
attribute float kind;
attribute vec3 base; // sRGB, of a film that shows the model's own materials
varying vec3 vBase;
varying vec3 vRest;
varying vec4 vState;
varying vec4 vFigures;
varying float vKind;
`;

const FRAGMENT_HEAD = /* glsl */ `
precision highp sampler3D;
uniform sampler3D noiseMap;
uniform sampler2D scaleMap;
uniform vec3 palette[9]; // primer, steel, rim, body and core of rust, stain, depth of a stain, dust, unpainted
uniform vec3 paint;
uniform vec3 fallLine;
uniform vec4 stateShare, figureShare; // which scalar the overlay shows; all 0 for none
uniform float overlay, exposure;
uniform bool filmShown, hasBase;
varying vec3 vBase;
uniform mat3 normalMatrix;
varying vec3 vRest;
varying vec4 vState;
varying vec4 vFigures;
varying float vKind;
float wcRoughness, wcMetalness, wcGloss;
vec3 wcBump;

vec4 noise(vec3 at) {
  vec4 texel = texture(noiseMap, at / ${CELLS}.0);
  return vec4((texel.xyz - 0.5) * 8.0, texel.w);
}

vec4 fractal(vec3 at, float frequency, int octaves) {
  vec4 total = vec4(0.0);
  float weight = 0.0, height = 1.0, f = frequency;
  for (int octave = 0; octave < octaves; octave++) {
    vec4 n = noise(at * f + 17.31 * float(octave) * vec3(1.0, 1.7, 2.3));
    total += height * vec4(f * n.xyz, n.w);
    weight += height;
    height *= 0.5;
    f *= 2.03;
  }
  return total / weight;
}

// linear up to 0.55, then bent, so that only far brighter light becomes white
vec3 tone(vec3 light) {
  return mix(light, 0.55 + 0.45 * (1.0 - exp(-(light - 0.55) / 0.45)), step(0.55, light));
}

float rustLayer(float amount, inout vec3 albedo) {
  if (amount <= 0.004) return 0.0;
  vec4 patches = fractal(vRest, 9.0, 4);
  vec4 grain = fractal(vRest, 64.0, 3);
  float level = 1.5 * amount - 1.6 * (patches.w - 0.2) + 0.5 * (grain.w - 0.5) * (1.0 - 0.5 * amount);
  albedo = mix(albedo, palette[4], 0.45 * smoothstep(-0.4, 0.05, level));
  float cover = smoothstep(-0.05, 0.12, level);
  float region = noise(vRest * 4.3 + vec3(5.0, 0.0, 0.0)).w;
  float mottle = 0.45 * patches.w + 0.55 * grain.w;
  float age = level + 2.4 * (0.5 - mottle) + 0.5 * (region - 0.5);
  vec3 rust = mix(palette[2], palette[3], smoothstep(0.0, 0.4, age));
  rust = mix(rust, palette[4], 0.9 * smoothstep(0.35, 1.35, age));
  rust = mix(rust, palette[2], 0.55 * smoothstep(0.54, 0.7, mottle) * smoothstep(0.3, 0.7, region));
  rust *= (0.6 + 0.8 * grain.w) * (1.0 - 0.7 * smoothstep(0.6, 0.7, grain.w) * smoothstep(0.2, 0.6, level));
  albedo = mix(albedo, rust, cover);
  wcBump += cover * 0.007 * grain.xyz;
  return cover;
}

vec3 linearOf(vec3 color) {
  return mix(color / 12.92, pow((color + 0.055) / 1.055, vec3(2.4)), step(0.04045, color));
}

vec3 paintFilm(vec3 color) {
  vec4 cloud = fractal(vRest, 6.0, 4);
  vec3 albedo = color * (0.84 + 0.32 * cloud.w);
  wcBump += 0.028 * noise(vRest * 95.0).xyz;
  wcRoughness = 0.34 + 0.18 * cloud.w;
  float stain = vState.x, dirt = vState.y;
  if (stain > 0.01) {
    float fall = dot(vRest, fallLine);
    float streak = fractal(42.0 * (vRest - fall * fallLine) + 4.0 * fall * fallLine, 1.0, 3).w;
    float cover = smoothstep(0.0, 0.9, stain * (0.3 + 2.0 * max(0.0, streak - 0.15)));
    albedo *= exp(-cover * palette[6]);
    albedo = mix(albedo, palette[5], 0.85 * pow(cover, 1.3));
    wcRoughness += 0.35 * cover;
    wcGloss *= 1.0 - 0.7 * cover;
  }
  if (dirt > 0.01) {
    float veil = (1.0 - exp(-1.4 * dirt)) * min(1.0, 0.45 + 0.9 * fractal(vRest, 28.0, 3).w);
    albedo = mix(albedo, palette[7], 0.85 * veil);
    wcRoughness += 0.4 * veil;
    wcGloss *= 1.0 - 0.9 * veil;
  }
  wcRoughness = min(wcRoughness, 0.95);
  return albedo;
}

vec3 surfaceColor(vec3 own) {
  wcBump = vec3(0.0);
  wcRoughness = 0.6;
  wcMetalness = 0.0;
  wcGloss = 1.0;
  vec3 albedo;
  if (vKind < 0.5 || (vKind > 1.5 && vKind < 2.5 && vState.w > 0.6)) {
    return paintFilm(hasBase ? linearOf(vBase) : paint);
  } else if (vKind < 2.5) {
    float value = fractal(vRest, 30.0, 3).w;
    albedo = palette[0] * (0.82 + 0.3 * value);
    if (vKind > 1.5) albedo = mix(albedo, palette[7], 0.75 * smoothstep(0.38, 0.6, value)) * 0.8;
    float cover = rustLayer(0.6 * vState.z, albedo);
    wcRoughness = 0.8;
    wcGloss = 0.5 * (1.0 - cover);
  } else if (vKind < 3.5) {
    float scale = fractal(vRest, 14.0, 4).w;
    albedo = palette[1] * (0.75 + 0.5 * scale);
    float cover = rustLayer(vState.z, albedo);
    float veil = 0.5 * (1.0 - exp(-1.4 * vState.y));
    albedo = mix(albedo, palette[7], veil);
    wcMetalness = 0.6 * (1.0 - cover) * (1.0 - veil);
    wcRoughness = 0.42 + 0.2 * scale + 0.45 * cover;
    wcGloss = 1.0 - 0.6 * cover;
  } else {
    albedo = own;
    wcRoughness = 0.5;
  }
  return albedo;
}
`;

const OVERLAY = /* glsl */ `
if (overlay > 0.5) {
  float shade = 0.7 + 0.3 * clamp(nonPerturbedNormal.z * 0.8 + nonPerturbedNormal.y * 0.3, 0.0, 1.0);
  float value = clamp(dot(vState, stateShare) + dot(vFigures, figureShare), 0.0, 1.0);
  bool isFilm = vKind < 2.5;
  bool has = vKind < 3.5 && (isFilm || dot(figureShare, vec4(1.0)) < 0.5);
  vec3 flatColor = has ? texture2D(scaleMap, vec2((value * 255.0 + 0.5) / 256.0, 0.5)).rgb : vec3(0.22);
  outgoingLight = flatColor * shade * mix(1.0, openness, 0.6);
}
`;

/** A material that shows every part; its uniforms are shared with the caller. */
export function makeMaterial(noiseMap, about) {
  const linear = (rgb) => new Color().setRGB(...rgb); // the page has linear colours
  const uniforms = {
    noiseMap: { value: noiseMap },
    scaleMap: { value: null },
    palette: { value: about.palette.map((rgb) => new Vector3(...rgb)) },
    paint: { value: linear(about.paint) },
    fallLine: { value: new Vector3(...about.up) },
    stateShare: { value: new Vector4() },
    figureShare: { value: new Vector4() },
    overlay: { value: 0 },
    exposure: { value: 1 },
    filmShown: { value: true },
    hasBase: { value: false },
  };
  const material = new MeshStandardMaterial({ side: DoubleSide, vertexColors: false });
  material.onBeforeCompile = (shader) => {
    Object.assign(shader.uniforms, uniforms);
    shader.vertexShader =
      VERTEX_HEAD +
      shader.vertexShader.replace(
        "#include <begin_vertex>",
        "#include <begin_vertex>\nvRest = rest; vState = state; vFigures = figures; vKind = kind; vBase = base;",
      );
    shader.fragmentShader =
      FRAGMENT_HEAD +
      shader.fragmentShader
        .replace("#include <color_fragment>", "diffuseColor.rgb = surfaceColor(palette[8]);")
        .replace("#include <roughnessmap_fragment>", "float roughnessFactor = wcRoughness;")
        .replace("#include <metalnessmap_fragment>", "float metalnessFactor = wcMetalness;")
        .replace(
          "#include <normal_fragment_maps>",
          /* glsl */ `
          vec3 bump = normalMatrix * wcBump;
          normal = normalize(normal - (bump - dot(bump, normal) * normal));`,
        )
        .replace(
          "#include <lights_physical_fragment>",
          /* glsl */ `#include <lights_physical_fragment>
          material.specularF90 = mix(wcGloss, 1.0, metalnessFactor);
          material.specularColorBlended = mix(0.04 * wcGloss * vec3(1.0), diffuseColor.rgb, metalnessFactor);`,
        )
        .replace(
          "#include <aomap_fragment>",
          /* glsl */ `
          float openness = vKind > 2.5 && !filmShown ? 1.0 : vFigures.w; // only film darkens metal
          reflectedLight.indirectDiffuse *= openness;
          reflectedLight.directDiffuse *= mix(1.0, openness, 0.35);
          reflectedLight.indirectSpecular *= openness * openness;`,
        )
        .replace("#include <opaque_fragment>", OVERLAY + "#include <opaque_fragment>")
        .replace("#include <tonemapping_fragment>", "if (overlay < 0.5) gl_FragColor.rgb = tone(gl_FragColor.rgb * exposure);");
  };
  return { material, uniforms };
}
