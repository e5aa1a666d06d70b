// The page: the scene, its controls, and what the address asks for.
import {
  Box3,
  DataTexture,
  Group,
  PCFShadowMap,
  PerspectiveCamera,
  Quaternion,
  Raycaster,
  Scene,
  Vector2,
  Vector3,
  WebGLRenderer,
} from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import { makeFigures } from "./figures.js";
import { Ground, Lighting, LIGHTS } from "./light.js";
import { makeMaterial } from "./material.js";
import { Model } from "./model.js";
import { makeNoise } from "./noise.js";
import { gradient, makeScale, OVERLAYS } from "./scale.js";

const PERIOD = 800; // of a snapshot while it plays, ms
const BACKGROUNDS = { auto: "Auto", light: "Light", dark: "Dark", transparent: "None" };
const MOST_PROBED = 400_000; // faces through which a ray is sent at each move of the pointer
const element = (id) => document.getElementById(id);
const about = JSON.parse(element("about").textContent);
const snapshots = about.snapshots;

/** What is shown where the part of the address after # says nothing else; that follows what is shown. */
const DEFAULTS = {
  shown: snapshots.length - 1,
  before: 0,
  compare: false,
  divider: 0.5,
  overlay: "none",
  light: "studio",
  background: "auto",
  film: true,
  metal: true,
  untouched: true,
  bare: false,
};
const state = { ...DEFAULTS };
const STRAIGHT = { azimuth: 0, elevation: 0, zoom: 1 };
const view = { ...STRAIGHT };

const indexOf = (step) => {
  const distances = snapshots.map((snapshot) => Math.abs(snapshot.step - step));
  return distances.indexOf(Math.min(...distances));
};

function readAddress() {
  const asked = { ...about.start, ...Object.fromEntries(new URLSearchParams(location.hash.slice(1))) };
  Object.assign(state, DEFAULTS);
  Object.assign(view, STRAIGHT);
  if (asked.step !== undefined) state.shown = indexOf(Number(asked.step));
  if (asked.after !== undefined) state.shown = indexOf(Number(asked.after));
  if (asked.before !== undefined) state.before = indexOf(Number(asked.before));
  state.compare = asked.before !== undefined && snapshots.length > 1;
  if (asked.divider !== undefined) state.divider = Math.max(0, Math.min(1, Number(asked.divider) || 0));
  state.overlay = asked.overlay in overlays ? asked.overlay : "none";
  if (asked.light in LIGHTS) state.light = asked.light;
  if (asked.background in BACKGROUNDS) state.background = asked.background;
  for (const part of ["film", "metal", "untouched"]) state[part] = asked[part] !== "0";
  state.bare = asked.ui === "0";
  for (const name of ["azimuth", "elevation", "zoom"]) {
    if (Number.isFinite(Number(asked[name] ?? NaN))) view[name] = Number(asked[name]);
  }
}

function writeAddress() {
  const asked = new URLSearchParams();
  asked.set(state.compare ? "after" : "step", snapshots[state.shown].step);
  if (state.compare) asked.set("before", snapshots[state.before].step);
  if (state.overlay !== "none") asked.set("overlay", state.overlay);
  if (state.light !== "studio") asked.set("light", state.light);
  if (state.background !== "auto") asked.set("background", state.background);
  for (const part of ["film", "metal", "untouched"]) if (!state[part]) asked.set(part, "0");
  if (state.bare) asked.set("ui", "0");
  for (const name of ["azimuth", "elevation", "zoom"]) {
    if (view[name] !== STRAIGHT[name]) asked.set(name, view[name]);
  }
  history.replaceState(null, "", `#${asked}`);
}

const overlays = Object.fromEntries(
  Object.entries(OVERLAYS).filter(([name]) => name !== "risk" || about.layouts.some((each) => each.some(([of]) => of === "risk"))),
);

const canvas = element("view");
const renderer = new WebGLRenderer({ canvas, antialias: true, alpha: true, preserveDrawingBuffer: false });
renderer.shadowMap.enabled = true;
renderer.shadowMap.type = PCFShadowMap;
renderer.shadowMap.autoUpdate = false;

const scene = new Scene();
const turned = new Group(); // the model, with its up along y
turned.quaternion.copy(new Quaternion().setFromUnitVectors(new Vector3(...about.up), new Vector3(0, 1, 0)));
scene.add(turned);
const camera = new PerspectiveCamera(26, 1, 0.01, 100);
const controls = new OrbitControls(camera, canvas);
controls.enableDamping = true;
controls.dampingFactor = 0.12;
controls.maxPolarAngle = Math.PI * 0.98;
controls.listenToKeyEvents(canvas);
controls.keys = {}; // the arrows are for time

const { material, uniforms } = makeMaterial(makeNoise(), about);
const chunks = [...document.querySelectorAll("script.chunk")].map((each) => each.textContent);
const model = new Model(about, chunks, material);
const scales = {};
let lighting, ground, box, radius, shown, beforeShown, showFigures;
let isDirty = true;

const invalidate = (withShadow = false) => {
  isDirty = true;
  if (withShadow) renderer.shadowMap.needsUpdate = true;
};

/** Puts the camera where all of the model is seen, from the direction that the page gives. */
function frame() {
  const { width, height } = canvas.getBoundingClientRect();
  const roomy = document.body.classList.contains("roomy");
  const free = roomy ? { left: 0, right: 340, top: 40, bottom: 80 } : { left: 0, right: 0, top: 60, bottom: 80 };
  if (state.bare) Object.assign(free, { left: 0, right: 0, top: 0, bottom: 0 });
  const direction = new Vector3(...about.view).applyQuaternion(turned.quaternion);
  const y = new Vector3(0, 1, 0);
  direction.applyAxisAngle(y, (view.azimuth * Math.PI) / 180);
  const side = new Vector3().crossVectors(direction, y).normalize();
  direction.applyAxisAngle(side, (view.elevation * Math.PI) / 180);
  const target = box.getCenter(new Vector3());
  camera.aspect = width / height;
  camera.position.copy(target).addScaledVector(direction, 10);
  camera.lookAt(target);
  camera.updateMatrixWorld();
  const slopeY = Math.tan((camera.fov * Math.PI) / 360);
  const share = [1 - (free.left + free.right) / width, 1 - (free.top + free.bottom) / height];
  const [slopeX, slopeFree] = [slopeY * camera.aspect * share[0] * 0.88, slopeY * share[1] * 0.88];
  const inverse = camera.matrixWorldInverse;
  let distance = 0;
  const point = new Vector3();
  for (let i = 0; i < model.base.points.length; i += 3) {
    point.fromArray(model.base.points, i).applyQuaternion(turned.quaternion).applyMatrix4(inverse);
    const depth = point.z + 10;
    distance = Math.max(distance, depth + Math.abs(point.x) / slopeX, depth + Math.abs(point.y) / slopeFree);
  }
  distance /= view.zoom;
  camera.position.copy(target).addScaledVector(direction, distance);
  camera.near = distance / 100;
  camera.far = distance + 40 * radius;
  controls.target.copy(target);
  controls.minDistance = 0.05 * radius;
  controls.maxDistance = 6 * distance;
  // the middle of what the panels leave free
  camera.setViewOffset(width, height, (free.right - free.left) / 2, (free.bottom - free.top) / 2, width, height);
  camera.updateProjectionMatrix();
  controls.update();
  controls.saveState();
  invalidate(true);
}

function resize() {
  const { width, height } = element("stage").getBoundingClientRect();
  document.body.classList.toggle("roomy", width > 900 && !state.bare);
  renderer.setPixelRatio(Math.min(2, devicePixelRatio));
  renderer.setSize(width, height, false);
  if (box) frame();
}

async function show() {
  const wanted = state.compare ? [state.shown, state.before] : [state.shown];
  const [after, before] = await Promise.all(wanted.map((i) => model.load(i)));
  if (wanted[0] !== state.shown || (state.compare && wanted[1] !== state.before)) return;
  shown = after;
  beforeShown = before;
  for (const made of [after, before]) if (made) turned.add(made.film, made.metal);
  for (const mesh of [...turned.children]) {
    const isWanted = [after, before].some((made) => made && (made.film === mesh || made.metal === mesh));
    if (!isWanted && mesh !== model.untouched) turned.remove(mesh);
  }
  await model.trim(wanted);
  invalidate(true);
  document.documentElement.dataset.shown = wanted.map((i) => snapshots[i].step).join(" ");
}

function reveal(made) {
  for (const each of [shown, beforeShown]) {
    if (!each) continue;
    each.film.visible = state.film && each === made;
    each.metal.visible = state.metal && each === made;
  }
  if (model.untouched) model.untouched.visible = state.untouched;
}

function draw() {
  const { width, height } = renderer.getSize(new Vector2());
  renderer.setScissorTest(false);
  renderer.clear();
  if (!state.compare || !beforeShown) {
    reveal(shown);
    renderer.render(scene, camera);
    return;
  }
  const cut = Math.round(width * state.divider);
  renderer.setScissorTest(true);
  for (const [made, left, right] of [
    [beforeShown, 0, cut],
    [shown, cut, width],
  ]) {
    if (right <= left) continue;
    reveal(made);
    renderer.shadowMap.needsUpdate = true;
    renderer.setScissor(left, 0, right - left, height);
    renderer.render(scene, camera);
  }
  renderer.setScissorTest(false);
}

function loop() {
  requestAnimationFrame(loop);
  if (controls.update()) isDirty = true;
  if (!isDirty || !shown) return;
  isDirty = false;
  ground.group.visible = camera.position.y > ground.group.position.y && (state.film || state.metal);
  draw();
  document.documentElement.dataset.ready = "yes";
}

// ---- what the controls set

function darkTheme() {
  if (state.background === "dark") return true;
  if (state.background === "light") return false;
  return state.light === "dark" || matchMedia("(prefers-color-scheme: dark)").matches;
}

function format(value) {
  return Number(value.toPrecision(3)).toString();
}

function ends(name) {
  const range = about.ranges[name];
  if (name === "strain") return [`\u2212${100 * range}\u202f%`, "0", `+${100 * range}\u202f%`];
  return ["0", "", format(range ?? 1)];
}

function applyOverlay() {
  const overlay = overlays[state.overlay];
  uniforms.overlay.value = overlay ? 1 : 0;
  element("legend").hidden = !overlay;
  if (!overlay) return;
  scales[state.overlay] ??= makeScale(overlay.colors);
  uniforms.scaleMap.value = scales[state.overlay];
  const share = (i) => [0, 1, 2, 3].map((k) => (k === i ? 1 : 0));
  uniforms.stateShare.value.set(...share(overlay.state));
  uniforms.figureShare.value.set(...share(overlay.figures));
  const legend = element("legend");
  legend.querySelector("b").textContent = overlay.label;
  legend.querySelector(".scale").style.background = gradient(overlay.colors);
  legend.querySelectorAll(".ends span").forEach((span, i) => (span.textContent = ends(state.overlay)[i]));
  legend.querySelector("p").textContent = overlay.note;
}

function apply() {
  const root = document.documentElement;
  root.dataset.theme = darkTheme() ? "dark" : "light";
  root.dataset.background = state.background;
  document.body.classList.toggle("bare", state.bare);
  applyOverlay();
  lighting.use(state.light);
  ground.use(LIGHTS[state.light]);
  uniforms.filmShown.value = state.film;
  uniforms.exposure.value = LIGHTS[state.light].exposure;
  for (const [id, value] of [["overlays", state.overlay], ["lights", state.light], ["backgrounds", state.background]]) {
    for (const button of element(id).children) {
      button.setAttribute("aria-checked", button.value === value);
      button.tabIndex = button.value === value ? 0 : -1;
    }
  }
  for (const button of element("parts").children) button.setAttribute("aria-pressed", state[button.value]);
  const slider = element("step");
  slider.value = state.shown;
  slider.style.setProperty("--done", `${(100 * state.shown) / Math.max(1, snapshots.length - 1)}%`);
  const text = (i) => `step ${snapshots[i].step.toLocaleString("en")}, age ${format(snapshots[i].age)}`;
  slider.setAttribute("aria-valuetext", text(state.shown));
  element("age").textContent = state.compare ? `${text(state.before)} \u2192 ${text(state.shown)}` : text(state.shown);
  element("compare").setAttribute("aria-pressed", state.compare);
  element("before-choice").hidden = !state.compare;
  element("before").value = state.before;
  element("divider").hidden = !state.compare;
  element("divider").style.left = `${100 * state.divider}%`;
  element("divider").setAttribute("aria-valuenow", Math.round(100 * state.divider));
  for (const [id, i] of [["side-before", state.before], ["side-after", state.shown]]) {
    element(id).hidden = !state.compare;
    element(id).textContent = `age ${format(snapshots[i].age)}`;
  }
  element("side-before").style.cssText = `left: auto; right: calc(${100 - 100 * state.divider}% + 26px)`;
  element("side-after").style.cssText = `left: calc(${100 * state.divider}% + 26px)`;
  showFigures(state.shown);
  element("probe").hidden = true; // of another state
  invalidate(true);
}

/** Changes what is shown, and everything that follows from it. */
function set(changes) {
  const before = { ...state };
  Object.assign(state, changes);
  apply();
  writeAddress();
  if (["shown", "before", "compare"].some((name) => before[name] !== state[name])) show();
}

let timer = null;
function play(isOn) {
  clearInterval(timer);
  timer = isOn ? setInterval(() => set({ shown: (state.shown + 1) % snapshots.length }), PERIOD) : null;
  element("play").classList.toggle("on", isOn);
  element("play").setAttribute("aria-label", isOn ? "Pause" : "Play");
}

function go(by) {
  play(false);
  set({ shown: Math.max(0, Math.min(snapshots.length - 1, state.shown + by)) });
}

function makeChoice(id, choices, key) {
  for (const [value, label] of Object.entries(choices)) {
    const button = element(id).appendChild(document.createElement("button"));
    Object.assign(button, { value, textContent: label, type: "button" });
    button.setAttribute("role", "radio");
    button.onclick = () => set({ [key]: value });
  }
  element(id).onkeydown = (event) => {
    const by = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
    if (!by) return;
    event.preventDefault();
    event.stopPropagation();
    const buttons = [...element(id).children];
    const next = buttons[(buttons.indexOf(event.target) + by + buttons.length) % buttons.length];
    next.click();
    next.focus();
  };
}

function makeControls() {
  const labels = Object.fromEntries(Object.entries(overlays).map(([name, { label }]) => [name, label]));
  makeChoice("overlays", { none: "Material", ...labels }, "overlay");
  makeChoice("lights", Object.fromEntries(Object.entries(LIGHTS).map(([name, { label }]) => [name, label])), "light");
  makeChoice("backgrounds", BACKGROUNDS, "background");
  const parts = { film: "Film", metal: "Metal", ...(model.untouched && { untouched: "Unpainted" }) };
  for (const [value, label] of Object.entries(parts)) {
    const button = element("parts").appendChild(document.createElement("button"));
    Object.assign(button, { value, textContent: label, type: "button" });
    button.onclick = () => set({ [value]: !state[value] });
  }
  const slider = element("step");
  slider.max = snapshots.length - 1;
  slider.oninput = () => {
    play(false);
    set({ shown: Number(slider.value) });
  };
  const every = Math.ceil(snapshots.length / 11);
  snapshots.forEach(({ age }, i) => {
    element("before").add(new Option(`age ${format(age)}`, i));
    if (i % every && i !== snapshots.length - 1) return;
    if (i !== snapshots.length - 1 && snapshots.length - 1 - i < every) return;
    const tick = element("time").querySelector(".ticks").appendChild(document.createElement("span"));
    tick.textContent = format(age);
    tick.style.left = `${(100 * i) / Math.max(1, snapshots.length - 1)}%`;
  });
  element("before").onchange = (event) => set({ before: Number(event.target.value) });
  element("time").hidden = snapshots.length === 1;
  element("play").onclick = () => play(!timer);
  element("compare").onclick = () => set({ compare: !state.compare });
  element("home").onclick = () => {
    Object.assign(view, STRAIGHT);
    frame();
  };
  element("picture").onclick = savePicture;
  element("panel-button").onclick = () => {
    const isOpen = document.body.classList.toggle("open");
    element("panel-button").setAttribute("aria-expanded", isOpen);
  };
  makeDivider(element("divider"));
  addEventListener("keydown", onKey);
  addEventListener("resize", resize);
  addEventListener("hashchange", () => {
    readAddress();
    resize();
    apply();
    show();
  });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", apply);
  controls.addEventListener("start", () => document.body.classList.remove("open"));
}

function makeDivider(divider) {
  const move = (event) => {
    const { left, width } = element("stage").getBoundingClientRect();
    set({ divider: Math.max(0, Math.min(1, (event.clientX - left) / width)) });
  };
  divider.onpointerdown = (event) => {
    divider.setPointerCapture(event.pointerId);
    divider.onpointermove = move;
  };
  divider.onpointerup = divider.onpointercancel = () => (divider.onpointermove = null);
  divider.onkeydown = (event) => {
    const by = { ArrowLeft: -0.02, ArrowRight: 0.02, PageDown: -0.1, PageUp: 0.1, Home: -1, End: 1 }[event.key];
    if (!by) return;
    event.preventDefault();
    event.stopPropagation();
    set({ divider: Math.max(0, Math.min(1, state.divider + by)) });
  };
}

function onKey(event) {
  if (event.ctrlKey || event.metaKey || event.altKey || event.target.matches("input, select")) return;
  const names = ["none", ...Object.keys(OVERLAYS)];
  const actions = {
    ArrowLeft: () => go(-1),
    ArrowRight: () => go(1),
    Home: () => go(-snapshots.length),
    End: () => go(snapshots.length),
    c: () => snapshots.length > 1 && set({ compare: !state.compare }),
    f: () => set({ film: !state.film }),
    m: () => set({ metal: !state.metal }),
    s: savePicture,
    r: () => element("home").click(),
    Escape: () => document.body.classList.remove("open"),
  };
  if (!event.target.matches("button")) actions[" "] = () => element("play").click();
  const action = /^[0-5]$/.test(event.key)
    ? () => names[event.key] in { none: 0, ...overlays } && set({ overlay: names[event.key] })
    : actions[event.key];
  if (!action) return;
  event.preventDefault();
  action();
}

/** Saves what is seen, without the controls, on the background that is chosen or none. */
function savePicture() {
  draw();
  const picture = Object.assign(document.createElement("canvas"), { width: canvas.width, height: canvas.height });
  const context = picture.getContext("2d");
  if (state.background !== "transparent") {
    context.fillStyle = darkTheme() ? "#232528" : "#e9e7e2";
    context.fillRect(0, 0, picture.width, picture.height);
  }
  context.drawImage(canvas, 0, 0);
  const link = document.createElement("a");
  link.download = `${about.name}_${snapshots[state.shown].step}.png`;
  link.href = picture.toDataURL("image/png");
  link.click();
  invalidate();
}

// ---- the values under the pointer

const raycaster = new Raycaster();
let probing = 0;

function probe(event) {
  clearTimeout(probing);
  element("probe").hidden = true;
  if (!overlays[state.overlay] || !shown || event.buttons || event.pointerType === "touch") return;
  const at = { x: event.clientX, y: event.clientY };
  probing = setTimeout(() => {
    const text = valueAt(at);
    const box = element("probe");
    box.hidden = !text;
    box.textContent = text;
    box.style.left = `${at.x + 16}px`;
    box.style.top = `${at.y + 14}px`;
  }, 40);
}

/** The value of the overlay at a place of the window, as text; empty where there is none. */
function valueAt({ x, y }) {
  const { left, top, width, height } = canvas.getBoundingClientRect();
  const place = [(x - left) / width, (y - top) / height];
  const made = state.compare && place[0] < state.divider ? beforeShown : shown;
  if (!made || made.faces > MOST_PROBED) return "";
  raycaster.setFromCamera(new Vector2(2 * place[0] - 1, 1 - 2 * place[1]), camera);
  const meshes = [...(state.film ? [made.film] : []), ...(state.metal ? [made.metal] : [])];
  const [hit] = raycaster.intersectObjects(meshes, false);
  if (!hit) return "";
  const isFilm = hit.object === made.film;
  const overlay = overlays[state.overlay];
  const name = isFilm ? overlay.film : overlay.metal;
  if (!name) return "metal";
  const { sources } = hit.object.geometry.userData;
  const corners = [hit.face.a, hit.face.b, hit.face.c].map((corner) => sources[corner]);
  const vertices = isFilm && name === "dirt" ? corners.map((v) => made.origin[v]) : corners;
  const weights = barycentric(hit);
  const share = vertices.reduce((sum, v, i) => sum + (weights[i] * made.arrays[name][v]) / 255, 0);
  const range = about.ranges[state.overlay] ?? 1;
  const value = state.overlay === "strain" ? 200 * range * (share - 0.5) : share * range;
  const shownValue = state.overlay === "strain" ? `${value.toFixed(1)}\u202f%` : value.toFixed(2);
  return `${overlay.label} ${shownValue}\n${isFilm ? "film" : "metal"}`;
}

function barycentric({ face, object, point }) {
  const position = object.geometry.getAttribute("position");
  const local = object.worldToLocal(point.clone());
  const [a, b, c] = [face.a, face.b, face.c].map((corner) => new Vector3().fromBufferAttribute(position, corner));
  const area = (p, q, r) => q.clone().sub(p).cross(r.clone().sub(p)).length();
  const total = area(a, b, c) || 1;
  return [area(local, b, c) / total, area(a, local, c) / total, area(a, b, local) / total];
}

// ---- from the beginning

async function begin() {
  readAddress();
  document.body.classList.toggle("bare", state.bare);
  await model.begin();
  uniforms.hasBase.value = model.baseColors !== null;
  if (model.untouched) turned.add(model.untouched);
  const places = new Float32Array(model.base.points);
  const point = new Vector3();
  for (let i = 0; i < places.length; i += 3) {
    point.fromArray(places, i).applyQuaternion(turned.quaternion).toArray(places, i);
  }
  box = new Box3().setFromArray(places);
  if (model.untouched) {
    turned.updateMatrixWorld(true);
    box.expandByObject(model.untouched);
  }
  radius = box.getSize(new Vector3()).length() / 2;
  lighting = new Lighting(renderer, scene, radius);
  lighting.key.target.position.copy(box.getCenter(new Vector3()));
  ground = new Ground(places, box.min.y - about.thickness.metal, radius);
  scene.add(ground.group);
  const empty = new DataTexture(new Uint8Array(4), 1, 1);
  empty.needsUpdate = true;
  uniforms.scaleMap.value = empty;
  showFigures = makeFigures(element("figures"), snapshots);
  makeControls();
  resize();
  apply();
  await show();
  canvas.addEventListener("pointermove", probe);
  canvas.addEventListener("pointerleave", () => (element("probe").hidden = true));
  controls.addEventListener("change", () => invalidate());
  element("notice").hidden = true;
  loop();
  for (let i = 0; i < snapshots.length; i++) {
    await new Promise((done) => setTimeout(done, 30));
    await model.load(i);
    await model.trim([state.shown, ...(state.compare ? [state.before] : [])]);
  }
}

begin().catch((error) => {
  element("notice").hidden = false;
  element("notice").textContent = `This page cannot be shown: ${error.message}`;
  console.error(error);
});
