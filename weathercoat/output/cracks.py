"""Cracks as a graph on the metal: where the film has come apart, where it ends, and how cracks meet."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from weathercoat.mesh.surface import Indices, Vectors
from weathercoat.sim.snapshot import Snapshot

# Edges of the mesh along which the direction of an arm is taken: the first alone has that of the mesh.
ARM_EDGES = 3


class Openings(NamedTuple):
    """The half-edges of the film that lie at an opening.

    ends: for each half-edge 3 f + i of the film's m faces the vertices of the metal that it runs between, (3
    m, 2). apart: whether it has come apart from its twin (3 m,), which holds for both. at_loss: the numbers
    of those whose twin is lost. twin: the number of its twin, (3 m,), of no meaning where there is none.
    """

    ends: NDArray[np.int64]
    apart: NDArray[np.bool_]
    at_loss: NDArray[np.intp]
    twin: NDArray[np.intp]

    def lengths(self, snapshot: Snapshot) -> Vectors:
        """The length at rest of each half-edge, (3 m,)."""
        places = snapshot.substrate_vertices[self.ends]
        length: Vectors = np.linalg.norm(places[:, 1] - places[:, 0], axis=1)
        return length

    def edges(self) -> NDArray[np.int64]:
        """The edges of cracks and outlines, (e, 2), as rising pairs of the metal's vertices."""
        is_open = self.is_open()
        count = self.ends.max(initial=0) + 1
        low, high = self.ends[is_open].min(axis=1), self.ends[is_open].max(axis=1)
        return np.stack(np.divmod(np.unique(low * count + high), count), axis=1)

    def is_open(self) -> NDArray[np.bool_]:
        """Whether there is an opening along each half-edge, be it a crack or an outline, (3 m,)."""
        found = self.apart.copy()
        found[self.at_loss] = True
        return found


def find_openings(snapshot: Snapshot) -> Openings:
    """The openings of the film of a snapshot."""
    count = len(snapshot.substrate_vertices)
    faces = snapshot.film_faces
    tail, head = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    origin = snapshot.film_origin.astype(np.int64)
    ends = np.stack([origin[tail], origin[head]], axis=1)
    forward = ends[:, 0] * count + ends[:, 1]
    backward = ends[:, 1] * count + ends[:, 0]
    order = np.argsort(forward, kind="stable")
    place, has_twin = _find(backward, forward[order])
    twin = order[place]
    apart = has_twin & ((tail != head[twin]) | (head != tail[twin]))

    metal = snapshot.substrate_faces.astype(np.int64)
    metal_edges = np.sort((metal * count + np.roll(metal, -1, axis=1)).ravel())
    at_loss = np.flatnonzero(~has_twin)
    return Openings(ends, apart, at_loss[_find(backward[at_loss], metal_edges)[1]], twin)


@dataclass(frozen=True)
class CrackGraph:
    """A graph of e edges, each as two arms: from one of its ends to the other.

    tail, head: int64 (2 e,), arms by the number of their tail. direction: unit vectors (2 e, 3) along the
    arms; length: (2 e,). degree: int64 (n,), the arms that start from each vertex of the metal.
    """

    tail: NDArray[np.int64]
    head: NDArray[np.int64]
    direction: Vectors
    length: Vectors
    degree: NDArray[np.int64]

    def straightness(self) -> Vectors:
        """The cosine between one edge of a crack and the next, at each vertex where just two meet."""
        first = np.flatnonzero((self.degree[self.tail] == 2) & (np.diff(self.tail, prepend=-1) != 0))
        return -np.einsum("ij,ij->i", self.direction[first], self.direction[first + 1])


def make_graph(edges: NDArray[np.int64], vertices: Vectors) -> CrackGraph:
    """The graph of edges (e, 2) between vertices (n, 3)."""
    tail, head = np.concatenate([edges, edges[:, ::-1]]).T
    order = np.argsort(tail, kind="stable")
    tail, head = tail[order], head[order]
    along = vertices[head] - vertices[tail]
    length = np.linalg.norm(along, axis=1)
    along = along / np.maximum(length, np.finfo(np.float64).tiny)[:, None]
    return CrackGraph(tail, head, along, length, np.bincount(tail, minlength=len(vertices)))


def junction_angles(graph: CrackGraph, vertices: Vectors, normals: Vectors) -> tuple[Indices, Vectors]:
    """The angles between neighbouring arms at the vertices where three arms or more meet: of each angle the
    vertex, and its size [degrees].

    An arm's direction is that to the point three edges along it, or to the junction or end before; angles are
    those of the arms laid into the plane across the vertex's normal, and sum to 360 degrees at each.
    """
    arms = np.flatnonzero(graph.degree[graph.tail] >= 3)
    tail = graph.tail[arms]
    first = np.searchsorted(graph.tail, np.arange(len(vertices)))
    previous, end = tail.copy(), graph.head[arms].copy()
    for _ in range(ARM_EDGES - 1):
        goes_on = graph.degree[end] == 2
        at = first[end[goes_on]]
        onward = np.where(graph.head[at] == previous[goes_on], graph.head[at + 1], graph.head[at])
        previous[goes_on], end[goes_on] = end[goes_on], onward
    normal = normals[tail]
    # A frame in the plane: the axis that the normal leans from most, and what is across both.
    axis = np.eye(3)[np.argmin(np.abs(normal), axis=1)]
    side = np.cross(normal, axis)
    ahead = np.cross(side, normal)
    ahead /= np.maximum(np.linalg.norm(ahead, axis=1), np.finfo(np.float64).tiny)[:, None]
    side /= np.maximum(np.linalg.norm(side, axis=1), np.finfo(np.float64).tiny)[:, None]
    arm = vertices[end] - vertices[tail]
    bearing = np.degrees(np.arctan2(np.einsum("ij,ij->i", arm, side), np.einsum("ij,ij->i", arm, ahead)))
    order = np.lexsort((bearing, tail))
    tail, bearing = tail[order], bearing[order]
    starts = np.flatnonzero(np.diff(tail, prepend=-1))
    following = np.arange(1, len(tail) + 1)
    following[np.append(starts, len(tail))[1:] - 1] = starts  # round each vertex
    return tail.astype(np.int32), np.mod(bearing[following] - bearing, 360.0)


def rim_vertices(faces: Indices) -> NDArray[np.int64]:
    """The vertices of the edges that one face has alone."""
    ends = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2).astype(np.int64)
    edges, uses = np.unique(np.sort(ends, axis=1), axis=0, return_counts=True)
    return np.unique(edges[uses == 1])


def _find(keys: NDArray[np.int64], table: NDArray[np.int64]) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Place of each key in a sorted table, and whether it is there."""
    if not len(table):
        return np.zeros(len(keys), np.intp), np.zeros(len(keys), np.bool_)
    place = np.minimum(np.searchsorted(table, keys), len(table) - 1)
    return place, table[place] == keys
