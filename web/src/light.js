// Light presets: an environment drawn by a shader, one key light with a soft shadow, and the ground.
import {
  BackSide,
  CanvasTexture,
  Color,
  DirectionalLight,
  Group,
  Mesh,
  MeshBasicMaterial,
  PlaneGeometry,
  PMREMGenerator,
  Scene,
  ShaderMaterial,
  ShadowMaterial,
  SphereGeometry,
  Vector3,
} from "three";

/** Radiances, linear; a panel is a lamp with a direction, half its extent in each way, softness and radiance. */
export const LIGHTS = {
  studio: {
    label: "Studio",
    sky: [0.62, 0.64, 0.68],
    horizon: [0.58, 0.58, 0.59],
    ground: [0.26, 0.25, 0.24],
    panels: [
      { at: [-0.75, 0.75, 0.45], extent: 0.38, radiance: 7 },
      { at: [0.95, 0.35, 0.25], extent: 0.22, radiance: 4 },
      { at: [0.1, 0.35, -1], extent: 0.3, radiance: 3 },
    ],
    key: { at: [-0.5, 1.1, 0.6], color: [1, 0.96, 0.9], power: 2.0 },
    shadow: 0.26,
    exposure: 1,
  },
  daylight: {
    label: "Daylight",
    sky: [0.3, 0.5, 0.95],
    horizon: [0.85, 0.9, 0.98],
    ground: [0.22, 0.2, 0.16],
    panels: [{ at: [0.6, 0.75, 0.5], extent: 0.16, radiance: 6 }],
    key: { at: [0.6, 0.75, 0.5], color: [1, 0.93, 0.8], power: 3.6 },
    shadow: 0.5,
    exposure: 0.92,
  },
  overcast: {
    label: "Overcast",
    sky: [1.15, 1.2, 1.28],
    horizon: [0.8, 0.83, 0.88],
    ground: [0.22, 0.22, 0.22],
    panels: [],
    key: { at: [0.1, 1, 0.45], color: [1, 1, 1], power: 0.7 },
    shadow: 0.22,
    exposure: 1.15,
  },
  dark: {
    label: "Dark",
    sky: [0.13, 0.14, 0.17],
    horizon: [0.11, 0.11, 0.12],
    ground: [0.04, 0.04, 0.04],
    panels: [
      { at: [-1, 0.35, -0.35], extent: 0.26, radiance: 6 },
      { at: [1, 0.5, -0.5], extent: 0.16, radiance: 5 },
      { at: [0.2, 1, 0.5], extent: 0.2, radiance: 2.5 },
    ],
    key: { at: [0.35, 0.9, 0.55], color: [1, 0.95, 0.88], power: 2.6 },
    shadow: 0.6,
    exposure: 1.05,
  },
};

const SKY = /* glsl */ `
uniform vec3 sky, horizon, ground;
uniform vec4 panels[3]; // direction and half extent
uniform float radiances[3];
varying vec3 vDirection;
void main() {
  vec3 d = normalize(vDirection);
  vec3 light = mix(ground, horizon, smoothstep(-0.22, 0.04, d.y));
  light = mix(light, sky, smoothstep(0.0, 0.7, d.y));
  for (int i = 0; i < 3; i++) {
    if (radiances[i] <= 0.0) continue;
    vec3 n = normalize(panels[i].xyz);
    vec3 across = normalize(cross(vec3(0.0, 1.0, 0.0), n));
    vec3 local = vec3(dot(d, across), dot(d, cross(n, across)), dot(d, n));
    vec2 place = abs(local.xy / max(local.z, 1e-3)) / vec2(panels[i].w, 1.35 * panels[i].w);
    float inside = smoothstep(1.15, 0.85, max(place.x, place.y)) * step(0.0, local.z);
    light += radiances[i] * inside;
  }
  gl_FragColor = vec4(light, 1.0);
}`;

/** The environment of a preset, prefiltered for rough reflections. */
function makeEnvironment(renderer, preset) {
  const [panels, radiances] = [[], []];
  for (let i = 0; i < 3; i++) {
    const panel = preset.panels[i] ?? { at: [0, 1, 0.1], extent: 1, radiance: 0 };
    panels.push([...panel.at, panel.extent]);
    radiances.push(panel.radiance);
  }
  const scene = new Scene();
  const material = new ShaderMaterial({
    side: BackSide,
    vertexShader:
      "varying vec3 vDirection; void main() { vDirection = position; gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0); }",
    fragmentShader: SKY,
    uniforms: {
      sky: { value: preset.sky },
      horizon: { value: preset.horizon },
      ground: { value: preset.ground },
      panels: { value: panels.flat() },
      radiances: { value: radiances },
    },
  });
  const sphere = new Mesh(new SphereGeometry(10, 32, 16), material);
  scene.add(sphere);
  const generator = new PMREMGenerator(renderer);
  const texture = generator.fromScene(scene, 0.01).texture;
  generator.dispose();
  sphere.geometry.dispose();
  material.dispose();
  return texture;
}

/** The lighting of a scene, in units where the object has a radius; `use` takes the name of a preset. */
export class Lighting {
  constructor(renderer, scene, radius) {
    this.renderer = renderer;
    this.scene = scene;
    this.radius = radius;
    this.environments = {};
    this.key = new DirectionalLight(0xffffff, 1);
    this.key.castShadow = true;
    this.key.shadow.mapSize.set(2048, 2048);
    this.key.shadow.radius = 14;
    this.key.shadow.normalBias = 0.006 * radius;
    this.key.shadow.bias = -0.0006;
    const reach = 1.35 * radius;
    Object.assign(this.key.shadow.camera, { left: -reach, right: reach, top: reach, bottom: -reach });
    Object.assign(this.key.shadow.camera, { near: 0.1 * radius, far: 8 * radius });
    scene.add(this.key, this.key.target);
  }

  use(name) {
    const preset = LIGHTS[name];
    this.environments[name] ??= makeEnvironment(this.renderer, preset);
    this.scene.environment = this.environments[name];
    this.key.position.copy(new Vector3(...preset.key.at).normalize().multiplyScalar(4 * this.radius));
    this.key.color = new Color().setRGB(...preset.key.color);
    this.key.intensity = preset.key.power;
  }
}

/** The ground: invisible but for the key light's shadow and a soft darkening under what stands near it. */
export class Ground {
  constructor(points, level, radius) {
    this.group = new Group();
    this.shadow = new Mesh(new PlaneGeometry(24 * radius, 24 * radius), new ShadowMaterial({ opacity: 0.3 }));
    this.shadow.receiveShadow = true;
    const side = 4 * radius;
    this.contact = new Mesh(
      new PlaneGeometry(side, side),
      new MeshBasicMaterial({ map: contactTexture(points, level, side), transparent: true, depthWrite: false }),
    );
    this.contact.material.toneMapped = false;
    this.contact.renderOrder = 1;
    for (const plane of [this.shadow, this.contact]) {
      plane.rotation.x = -Math.PI / 2;
      this.group.add(plane);
    }
    this.group.position.y = level;
    this.contact.position.y = 1e-3 * radius;
  }

  use(preset) {
    this.shadow.material.opacity = preset.shadow;
  }
}

/** How dark the ground is under points (x, y, z), as the opacity of black; what is high up counts little. */
function contactTexture(points, level, side) {
  const cells = 128;
  let field = new Float32Array(cells * cells);
  const cell = (x) => Math.floor((x / side + 0.5) * cells);
  for (let i = 0; i < points.length; i += 3) {
    const [column, row] = [cell(points[i]), cell(points[i + 2])];
    if (column < 0 || row < 0 || column >= cells || row >= cells) continue;
    const near = Math.exp((-12 * (points[i + 1] - level)) / side);
    field[row * cells + column] = Math.max(field[row * cells + column], near);
  }
  for (const width of [2, 4, 6]) field = blurred(blurred(field, cells, 1, width), cells, cells, width);
  const canvas = Object.assign(document.createElement("canvas"), { width: cells, height: cells });
  const context = canvas.getContext("2d");
  const image = context.createImageData(cells, cells);
  const most = Math.max(1e-6, ...field);
  for (let i = 0; i < field.length; i++) image.data[4 * i + 3] = 255 * 0.42 * Math.min(1, field[i] / most);
  context.putImageData(image, 0, 0);
  return new CanvasTexture(canvas);
}

/** Means over 2 width + 1 neighbours, `stride` apart. */
function blurred(field, cells, stride, width) {
  const out = new Float32Array(field.length);
  for (let i = 0; i < field.length; i++) {
    const at = stride === 1 ? i % cells : Math.floor(i / cells);
    let total = 0;
    for (let k = Math.max(-width, -at); k <= Math.min(width, cells - 1 - at); k++) total += field[i + k * stride];
    out[i] = total / (2 * width + 1);
  }
  return out;
}
