"""Triangles in texture space, as the texels that they own.

A texel belongs to the face that holds its centre. Corners are rounded to 1/4096 of a texel and sides are told
apart in whole numbers, with the top-left rule, so that a texel on a side that two faces share has one owner,
whatever the order of threads.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.mesh.closest import closest_on_triangle
from weathercoat.mesh.surface import Indices, Vectors

SUBTEXELS = 4096
_REACH = 0.72  # texels: just more than half the diagonal of one, so that no face is without any


@kernel
def rasterise(
    corner: NDArray[np.int64],
    first: int,
    face: Indices,
    weights: NDArray[np.float32],
    claimed_again: NDArray[np.uint8],
) -> None:
    """Find the owners of the texels in a band of rows.

    corner (m, 3, 2): column and row of the corners of faces in 1/SUBTEXELS of a texel. first: the row of the
    picture that is the band's first. face (r, w): gets the first face, in their order, that holds the centre
    of a texel, and stays as it is elsewhere; weights (r, w, 2): those of its second and third corner;
    claimed_again (r, w): 1 where more than one face holds the centre.

    Source of the rule: Pineda, A parallel algorithm for polygon rasterization, 1988.
    """
    rows, columns = face.shape
    half, one = SUBTEXELS // 2, SUBTEXELS
    for f in range(len(corner)):
        ax, ay, bx, by = corner[f, 0, 0], corner[f, 0, 1], corner[f, 1, 0], corner[f, 1, 1]
        cx, cy = corner[f, 2, 0], corner[f, 2, 1]
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if area == 0:
            continue
        top = max((min(ay, by, cy) - half + one - 1) // one, first)
        low = min((max(ay, by, cy) - half) // one, first + rows - 1)
        if top > low:
            continue
        left = max((min(ax, bx, cx) - half + one - 1) // one, 0)
        right = min((max(ax, bx, cx) - half) // one, columns - 1)
        is_turned = area < 0
        if is_turned:
            bx, by, cx, cy, area = cx, cy, bx, by, -area
        bias_a = 0 if _is_top_left(cx - bx, cy - by) else -1
        bias_b = 0 if _is_top_left(ax - cx, ay - cy) else -1
        bias_c = 0 if _is_top_left(bx - ax, by - ay) else -1
        for row in range(top, low + 1):
            y = row * one + half
            x = left * one + half
            ea = (cx - bx) * (y - by) - (cy - by) * (x - bx)
            eb = (ax - cx) * (y - cy) - (ay - cy) * (x - cx)
            ec = (bx - ax) * (y - ay) - (by - ay) * (x - ax)
            step_a, step_b, step_c = -(cy - by) * one, -(ay - cy) * one, -(by - ay) * one
            # the columns in which all three are inside, one after the other
            for column in range(left, right + 1):
                if ea + bias_a >= 0 and eb + bias_b >= 0 and ec + bias_c >= 0:
                    r = row - first
                    if face[r, column] < 0:
                        face[r, column] = f
                        v, w = eb / area, ec / area
                        weights[r, column, 0] = w if is_turned else v
                        weights[r, column, 1] = v if is_turned else w
                    else:
                        claimed_again[r, column] = 1
                ea += step_a
                eb += step_b
                ec += step_c


@kernel
def _is_top_left(dx: int, dy: int) -> bool:
    """Whether a side, of a face that is clockwise as seen with rows growing downwards, is a top or a left
    one.
    """
    return dy < 0 or (dy == 0 and dx > 0)


@kernel
def rasterise_slivers(
    corner: NDArray[np.int64], first: int, face: Indices, weights: NDArray[np.float32]
) -> None:
    """Give the texels without an owner (-1) that a face comes near to the first such face; the weights are
    those of its nearest point.

    So a face that is too thin to hold a centre has texels, and the outlines of charts are whole. Arguments
    as of `rasterise`; a face is given as -2 - face here, and turned into `face` by the caller.
    """
    rows, columns = face.shape
    scale = 1.0 / SUBTEXELS
    for f in range(len(corner)):
        low_y, high_y = corner[f, :, 1].min() * scale, corner[f, :, 1].max() * scale
        top, low = max(int(np.floor(low_y - 0.5 - _REACH)), first), int(np.ceil(high_y - 0.5 + _REACH))
        low = min(low, first + rows - 1)
        if top > low:
            continue
        ax, ay, bx, by = corner[f, 0, 0], corner[f, 0, 1], corner[f, 1, 0], corner[f, 1, 1]
        cx, cy = corner[f, 2, 0], corner[f, 2, 1]
        area = float((bx - ax) * (cy - ay) - (by - ay) * (cx - ax))
        left = max(int(np.floor(min(ax, bx, cx) * scale - 0.5 - _REACH)), 0)
        right = min(int(np.ceil(max(ax, bx, cx) * scale - 0.5 + _REACH)), columns - 1)
        for row in range(top, low + 1):
            for column in range(left, right + 1):
                r = row - first
                if face[r, column] != -1:
                    continue
                x, y = column + 0.5, row + 0.5
                squared, px, py, _ = closest_on_triangle(
                    x, y, 0.0,
                    ax * scale, ay * scale, 0.0,
                    bx * scale, by * scale, 0.0,
                    cx * scale, cy * scale, 0.0,
                )  # fmt: skip
                if squared > _REACH * _REACH:
                    continue
                face[r, column] = -2 - f
                px, py = px * SUBTEXELS, py * SUBTEXELS
                v, w = 0.0, 0.0
                if area != 0.0:
                    v = ((px - ax) * (cy - ay) - (py - ay) * (cx - ax)) / area
                    w = ((bx - ax) * (py - ay) - (by - ay) * (px - ax)) / area
                v = min(max(v, 0.0), 1.0)
                weights[r, column, 0] = v
                weights[r, column, 1] = min(max(w, 0.0), 1.0 - v)
    for r in range(rows):
        for column in range(columns):
            if face[r, column] < -1:
                face[r, column] = -2 - face[r, column]


def texel_corners(uv: Vectors, width: int, height: int) -> NDArray[np.int64]:
    """Column and row of texture coordinates (m, 3, 2), v upwards, in 1/SUBTEXELS of a texel."""
    scale = np.array([width, height], np.float64) * SUBTEXELS
    return np.rint((uv * (1.0, -1.0) + (0.0, 1.0)) * scale).astype(np.int64)
