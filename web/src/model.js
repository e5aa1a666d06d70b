// The film and the metal of each snapshot as meshes of three.js.
import { BufferAttribute, BufferGeometry, Mesh } from "three";
import { KIND } from "./material.js";
import { makeShell, openEdges, smoothOutline, splitByCrease } from "./shell.js";
import { fromGrid, unpackChunk, unpackFilm } from "./unpack.js";

const FILM_CREASE = Math.PI / 3;
const METAL_CREASE = Math.PI / 4;
const GAP = 0.25; // of the film's thickness, between film and metal
const BEVEL = 0.4; // of the film's thickness
const KEPT_FACES = 1_500_000; // of films that were built, beside the ones shown

/**
 * The meshes of a run. `film(i)` and `metal(i)` are those of snapshot i, of which `load(i)` must have been awaited;
 * `untouched` is the mesh of the parts without paint, or null.
 */
export class Model {
  constructor(about, chunks, material) {
    this.about = about;
    this.chunks = chunks;
    this.material = material;
    this.loaded = new Map();
  }

  async begin() {
    const arrays = await unpackChunk(this.chunks[0], this.about.layouts[0]);
    const rest = fromGrid(arrays.rest, this.about.grid);
    this.base = { rest: arrays.rest, faces: arrays.faces, points: rest, count: rest.length / 3 };
    const { faces, count } = this.base;
    this.baseColors = arrays.base ?? null;
    const open = openEdges(faces, count);
    this.onEdge = new Uint8Array(count);
    for (const corner of open) this.onEdge[faces[corner]] = 1;
    const shell =
      open.length && this.about.thickness.metal > 0
        ? makeShell(rest, faces, { thickness: this.about.thickness.metal, gap: -this.about.thickness.metal })
        : { points: rest, front: faces, back: [], rim: [] };
    const all = new Uint32Array(shell.front.length + shell.back.length + shell.rim.length);
    all.set(shell.front);
    all.set(shell.back, shell.front.length);
    all.set(shell.rim, shell.front.length + shell.back.length);
    this.metalShape = splitByCrease(shell.points, all, METAL_CREASE);
    const { index, source, normals } = this.metalShape;
    this.metalGeometry = plainGeometry(shell.points, index, source, normals);
    this.metalGeometry.setAttribute("rest", this.metalGeometry.getAttribute("position"));
    this.metalGeometry.setAttribute("kind", new BufferAttribute(new Uint8Array(source.length).fill(KIND.metal), 1));
    this.untouched = arrays.untouched ? this.makeUntouched(arrays) : null;
  }

  makeUntouched(arrays) {
    const points = fromGrid(arrays.untouched, this.about.untouched);
    const { index, source, normals } = splitByCrease(points, arrays.untouched_faces, METAL_CREASE);
    const geometry = plainGeometry(points, index, source, normals);
    geometry.setAttribute("rest", geometry.getAttribute("position"));
    const count = source.length;
    geometry.setAttribute("kind", new BufferAttribute(new Uint8Array(count).fill(KIND.untouched), 1));
    geometry.setAttribute("state", new BufferAttribute(new Uint8Array(4 * count), 4, true));
    geometry.setAttribute("figures", new BufferAttribute(new Uint8Array(4 * count).fill(255), 4, true));
    return this.makeMesh(geometry);
  }

  /** Unpack and build snapshot `i`, if that has not been done. */
  async load(i) {
    if (!this.loaded.has(i)) {
      const made = unpackChunk(this.chunks[i + 1], this.about.layouts[i + 1]).then((arrays) => this.build(arrays));
      this.loaded.set(i, made);
    }
    const made = await this.loaded.get(i);
    this.loaded.delete(i);
    this.loaded.set(i, Promise.resolve(made)); // the one used last comes last
    return made;
  }

  /** Forget what was used longest ago, but not the `wanted`, until no more than a fixed number of faces is kept. */
  async trim(wanted) {
    let faces = 0;
    for (const i of [...this.loaded.keys()].reverse()) {
      const made = await this.loaded.get(i);
      faces += made.faces;
      if (faces <= KEPT_FACES || wanted.includes(i)) continue;
      this.loaded.delete(i);
      for (const mesh of [made.film, made.metal]) {
        mesh.removeFromParent();
        mesh.geometry.dispose();
      }
    }
  }

  build(arrays) {
    const film = unpackFilm(this.base, arrays);
    return {
      film: this.makeMesh(this.filmGeometry(film, arrays)),
      metal: this.makeMesh(this.metalOf(arrays)),
      faces: film.faces.length / 3,
      arrays,
      origin: film.origin,
    };
  }

  makeMesh(geometry) {
    const mesh = new Mesh(geometry, this.material);
    mesh.castShadow = mesh.receiveShadow = true;
    return mesh;
  }

  metalOf(bytes) {
    const geometry = new BufferGeometry();
    for (const name of ["position", "normal", "rest", "kind"]) {
      geometry.setAttribute(name, this.metalGeometry.getAttribute(name));
    }
    geometry.setIndex(this.metalGeometry.index);
    geometry.boundingSphere = this.metalGeometry.boundingSphere;
    const { source } = this.metalShape;
    const { count } = this.base;
    const [state, figures] = [new Uint8Array(4 * source.length), new Uint8Array(4 * source.length)];
    const sources = new Uint32Array(source.length);
    for (let k = 0; k < source.length; k++) {
      const v = source[k] % count;
      sources[k] = v;
      state.set([bytes.rust[v], bytes.dirt[v], bytes.rust[v], 255], 4 * k);
      figures[4 * k + 3] = source[k] < count ? bytes.open_metal[v] : 200;
    }
    geometry.setAttribute("state", new BufferAttribute(state, 4, true));
    geometry.setAttribute("figures", new BufferAttribute(figures, 4, true));
    geometry.userData.sources = sources;
    return geometry;
  }

  filmGeometry(film, bytes) {
    const { faces, origin, places, count } = film;
    const points = fromGrid(places, this.about.grid);
    smoothOutline(points, faces, (v) => bytes.copies[origin[v]] > 2 || this.onEdge[origin[v]]);
    const thickness = this.about.thickness.film;
    const shell = makeShell(points, faces, { thickness, gap: GAP * thickness, bevel: BEVEL * thickness });
    const parts = [
      [shell.front, KIND.front],
      [shell.back, KIND.back],
      [shell.rim, KIND.rim],
    ].map(([of, kind]) => ({ kind, ...splitByCrease(shell.points, of, FILM_CREASE) }));
    const total = parts.reduce((sum, part) => sum + part.source.length, 0);
    const [position, rest, normal] = [0, 1, 2].map(() => new Float32Array(3 * total));
    const [state, figures] = [new Uint8Array(4 * total), new Uint8Array(4 * total)];
    const kinds = new Uint8Array(total);
    const base = this.baseColors && new Uint8Array(3 * total);
    const sources = new Uint32Array(total);
    const index = new Uint32Array(parts.reduce((sum, part) => sum + part.index.length, 0));
    let [at, corner] = [0, 0];
    for (const part of parts) {
      for (const k of part.index) index[corner++] = at + k;
      for (let k = 0; k < part.source.length; k++, at++) {
        const isBack = part.source[k] >= count;
        const v = part.source[k] % count;
        const metal = origin[v];
        sources[at] = v;
        kinds[at] = part.kind;
        for (let axis = 0; axis < 3; axis++) {
          position[3 * at + axis] = shell.points[3 * part.source[k] + axis];
          rest[3 * at + axis] = this.base.points[3 * metal + axis];
          normal[3 * at + axis] = part.normals[3 * k + axis];
        }
        if (base) base.set(this.baseColors.subarray(3 * metal, 3 * metal + 3), 3 * at);
        state.set([bytes.stain[v], bytes.dirt[metal], bytes.rust[metal], isBack ? 0 : 255], 4 * at);
        const open = isBack && part.kind === KIND.back ? bytes.open_back[v] : bytes.open_front[v];
        figures.set([bytes.adhesion[v], bytes.strain[v], bytes.risk?.[v] ?? 0, open], 4 * at);
      }
    }
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new BufferAttribute(position, 3));
    geometry.setAttribute("rest", new BufferAttribute(rest, 3));
    geometry.setAttribute("normal", new BufferAttribute(normal, 3));
    geometry.setAttribute("state", new BufferAttribute(state, 4, true));
    geometry.setAttribute("figures", new BufferAttribute(figures, 4, true));
    geometry.setAttribute("kind", new BufferAttribute(kinds, 1));
    if (base) geometry.setAttribute("base", new BufferAttribute(base, 3, true));
    geometry.setIndex(new BufferAttribute(index, 1));
    geometry.userData.sources = sources;
    return geometry;
  }
}

function plainGeometry(points, index, source, normals) {
  const position = new Float32Array(3 * source.length);
  for (let k = 0; k < source.length; k++) {
    for (let axis = 0; axis < 3; axis++) position[3 * k + axis] = points[3 * source[k] + axis];
  }
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(position, 3));
  geometry.setAttribute("normal", new BufferAttribute(new Float32Array(normals), 3));
  geometry.setIndex(new BufferAttribute(index, 1));
  geometry.computeBoundingSphere();
  return geometry;
}
