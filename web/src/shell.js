// Sheets as shells with a thickness, and normals that keep creases: as weathercoat/output/shell.py has them.

/** Normals of faces, of unit length. */
function faceNormals(points, faces) {
  const normals = new Float32Array(faces.length);
  for (let f = 0; f < faces.length; f += 3) {
    const [p, q, r] = [3 * faces[f], 3 * faces[f + 1], 3 * faces[f + 2]];
    const [ax, ay, az] = [points[q] - points[p], points[q + 1] - points[p + 1], points[q + 2] - points[p + 2]];
    const [bx, by, bz] = [points[r] - points[p], points[r + 1] - points[p + 1], points[r + 2] - points[p + 2]];
    const [x, y, z] = [ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx];
    const length = Math.hypot(x, y, z) || 1;
    normals[f] = x / length;
    normals[f + 1] = y / length;
    normals[f + 2] = z / length;
  }
  return normals;
}

/** The angle of each corner, with which it counts in a mean of normals. */
function cornerAngles(points, faces) {
  const angles = new Float32Array(faces.length);
  for (let corner = 0; corner < faces.length; corner++) {
    const f = corner - (corner % 3);
    const p = 3 * faces[corner];
    const q = 3 * faces[f + ((corner + 1) % 3)];
    const r = 3 * faces[f + ((corner + 2) % 3)];
    const [ax, ay, az] = [points[q] - points[p], points[q + 1] - points[p + 1], points[q + 2] - points[p + 2]];
    const [bx, by, bz] = [points[r] - points[p], points[r + 1] - points[p + 1], points[r + 2] - points[p + 2]];
    const cross = Math.hypot(ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx);
    angles[corner] = Math.atan2(cross, ax * bx + ay * by + az * bz);
  }
  return angles;
}

/** Corners by vertex: those of v are corners[start[v]] to corners[start[v + 1]]. */
function cornersByVertex(faces, count) {
  const start = new Uint32Array(count + 1);
  for (const v of faces) start[v + 1]++;
  for (let v = 0; v < count; v++) start[v + 1] += start[v];
  const next = start.slice();
  const corners = new Uint32Array(faces.length);
  for (let corner = 0; corner < faces.length; corner++) corners[next[faces[corner]]++] = corner;
  return { start, corners };
}

function vertexNormals(points, faces) {
  const normals = new Float32Array(points.length);
  const [facets, angles] = [faceNormals(points, faces), cornerAngles(points, faces)];
  for (let corner = 0; corner < faces.length; corner++) {
    const f = corner - (corner % 3);
    for (let axis = 0; axis < 3; axis++) normals[3 * faces[corner] + axis] += angles[corner] * facets[f + axis];
  }
  for (let v = 0; v < normals.length; v += 3) {
    const length = Math.hypot(normals[v], normals[v + 1], normals[v + 2]) || 1;
    for (let axis = 0; axis < 3; axis++) normals[v + axis] /= length;
  }
  return normals;
}

/** The half-edges, as corners that they start from, whose edge no other face has. */
export function openEdges(faces, count) {
  const { start, corners } = cornersByVertex(faces, count);
  const headOf = (corner) => faces[corner - (corner % 3) + ((corner + 1) % 3)];
  const open = [];
  for (let corner = 0; corner < faces.length; corner++) {
    const [tail, head] = [faces[corner], headOf(corner)];
    let uses = 0;
    for (let k = start[tail]; k < start[tail + 1]; k++) uses += headOf(corners[k]) === head;
    for (let k = start[head]; k < start[head + 1]; k++) uses += headOf(corners[k]) === tail;
    if (uses === 1) open.push(corner);
  }
  return open;
}

/** Smooths the open edges of a sheet within its surface, except at vertices that are `fixed`. */
export function smoothOutline(points, faces, isFixed) {
  const count = points.length / 3;
  const open = openEdges(faces, count);
  const headOf = (corner) => faces[corner - (corner % 3) + ((corner + 1) % 3)];
  const ends = new Uint8Array(count);
  for (const corner of open) {
    ends[faces[corner]]++;
    ends[headOf(corner)]++;
  }
  const normals = vertexNormals(points, faces);
  for (const factor of [0.5, -0.53]) {
    const total = new Float32Array(points.length);
    for (const corner of open) {
      const [tail, head] = [3 * faces[corner], 3 * headOf(corner)];
      for (let axis = 0; axis < 3; axis++) {
        total[head + axis] += points[tail + axis];
        total[tail + axis] += points[head + axis];
      }
    }
    for (let v = 0; v < count; v++) {
      if (ends[v] !== 2 || isFixed(v)) continue;
      const way = [0, 1, 2].map((axis) => factor * (0.5 * total[3 * v + axis] - points[3 * v + axis]));
      const along = way[0] * normals[3 * v] + way[1] * normals[3 * v + 1] + way[2] * normals[3 * v + 2];
      if (Math.abs(along) > 0.3 * Math.hypot(...way)) continue;
      for (let axis = 0; axis < 3; axis++) points[3 * v + axis] += way[axis] - along * normals[3 * v + axis];
    }
  }
}

/**
 * A sheet of n vertices thickened: points 0 to n - 1 are the front's, the others the back's. The back lies `gap`
 * over the sheet and the front `thickness` over the back; `bevel` draws the open edges of the front inwards.
 */
export function makeShell(points, faces, { thickness, gap = 0, bevel = 0 }) {
  const count = points.length / 3;
  const normals = vertexNormals(points, faces);
  const open = openEdges(faces, count);
  const shell = new Float32Array(2 * points.length);
  for (let i = 0; i < points.length; i++) {
    shell[i] = points[i] + (gap + thickness) * normals[i];
    shell[points.length + i] = points[i] + gap * normals[i];
  }
  if (bevel > 0) drawInwards(shell, points, faces, open, bevel);
  const back = new Uint32Array(faces.length);
  for (let f = 0; f < faces.length; f += 3) {
    for (let i = 0; i < 3; i++) back[f + i] = faces[f + 2 - i] + count;
  }
  const rim = new Uint32Array(6 * open.length);
  open.forEach((corner, i) => {
    const [tail, head] = [faces[corner], faces[corner - (corner % 3) + ((corner + 1) % 3)]];
    rim.set([head, tail, tail + count, head, tail + count, head + count], 6 * i);
  });
  return { points: shell, front: faces, back, rim };
}

function drawInwards(shell, points, faces, open, length) {
  const facets = faceNormals(points, faces);
  const total = new Float32Array(points.length);
  const ends = new Float32Array(points.length / 3);
  const shortest = new Float32Array(ends.length).fill(Infinity);
  for (const corner of open) {
    const f = corner - (corner % 3);
    const [tail, head] = [faces[corner], faces[f + ((corner + 1) % 3)]];
    const edge = [0, 1, 2].map((axis) => points[3 * head + axis] - points[3 * tail + axis]);
    const [nx, ny, nz] = [facets[f], facets[f + 1], facets[f + 2]];
    const way = [ny * edge[2] - nz * edge[1], nz * edge[0] - nx * edge[2], nx * edge[1] - ny * edge[0]];
    const norm = Math.hypot(...way) || 1;
    for (const v of [tail, head]) {
      ends[v]++;
      shortest[v] = Math.min(shortest[v], Math.hypot(...edge));
      for (let axis = 0; axis < 3; axis++) total[3 * v + axis] += way[axis] / norm;
    }
  }
  for (let v = 0; v < ends.length; v++) {
    if (!ends[v]) continue;
    const [x, y, z] = [total[3 * v], total[3 * v + 1], total[3 * v + 2]];
    const mitre = ends[v] / Math.max(x * x + y * y + z * z, 0.25 * ends[v] ** 2);
    const size = Math.hypot(x, y, z) * mitre * length;
    const scale = mitre * length * Math.min(1, (0.25 * shortest[v]) / (size || 1));
    shell[3 * v] += scale * x;
    shell[3 * v + 1] += scale * y;
    shell[3 * v + 2] += scale * z;
  }
}

/**
 * Vertices for drawing: one for each corner's vertex and normal that differ. A corner's normal is the mean of the
 * faces round its vertex that turn by less than `crease` from its own. Returns the `index`, for each new vertex the
 * old one in `source`, and `normals`.
 */
export function splitByCrease(points, faces, crease) {
  const count = points.length / 3;
  const [facets, angles] = [faceNormals(points, faces), cornerAngles(points, faces)];
  const { start, corners } = cornersByVertex(faces, count);
  const least = Math.cos(crease);
  const index = new Uint32Array(faces.length);
  const [source, normals] = [[], []];
  for (let v = 0; v < count; v++) {
    const begun = source.length;
    for (let k = start[v]; k < start[v + 1]; k++) {
      const f = corners[k] - (corners[k] % 3);
      let [x, y, z] = [0, 0, 0];
      for (let l = start[v]; l < start[v + 1]; l++) {
        const g = corners[l] - (corners[l] % 3);
        const cosine = facets[f] * facets[g] + facets[f + 1] * facets[g + 1] + facets[f + 2] * facets[g + 2];
        if (cosine < least) continue;
        const weight = angles[corners[l]];
        x += weight * facets[g];
        y += weight * facets[g + 1];
        z += weight * facets[g + 2];
      }
      const length = Math.hypot(x, y, z) || 1;
      [x, y, z] = [x / length, y / length, z / length];
      let found = begun;
      while (
        found < source.length &&
        x * normals[3 * found] + y * normals[3 * found + 1] + z * normals[3 * found + 2] < 0.9999
      ) {
        found++;
      }
      if (found === source.length) {
        source.push(v);
        normals.push(x, y, z);
      }
      index[corners[k]] = found;
    }
  }
  return { index, source, normals };
}
