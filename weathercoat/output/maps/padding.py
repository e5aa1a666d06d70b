"""Texels beyond the charts: each gets what the nearest texel of a chart has, so that filters meet no seam."""

from __future__ import annotations

import numpy as np

from weathercoat.compile import kernel
from weathercoat.mesh.surface import Indices


@kernel
def find_padding(face: Indices, reach: int, source: Indices) -> None:
    """The texel that each texel of a band shows: itself where it has a face, the nearest that has one within
    `reach`, or -1.

    face, source int32 (r, w); a texel is numbered row by row. Columns first, then rows: of equally near ones
    the leftmost column counts, then the upper row. As far as `reach` rows from its ends, the band may lack
    what the whole picture has.
    """
    rows, columns = face.shape
    near = np.empty((rows, columns), np.int32)  # by how many rows the nearest texel of the column is away
    far = reach + 1
    for column in range(columns):
        gap = far
        for row in range(rows):
            gap = 0 if face[row, column] >= 0 else min(gap + 1, far)
            near[row, column] = -gap
        gap = far
        for row in range(rows - 1, -1, -1):
            gap = 0 if face[row, column] >= 0 else min(gap + 1, far)
            if gap < -near[row, column]:
                near[row, column] = gap
    for row in range(rows):
        for column in range(columns):
            if near[row, column] == 0:
                source[row, column] = row * columns + column
                continue
            best, found = reach * reach + 1, -1
            for step in range(reach + 1):
                if step * step >= best:
                    break
                for side in range(2):
                    at = column - step if side == 0 else column + step
                    if at < 0 or at >= columns or (side == 1 and step == 0):
                        continue
                    gap = near[row, at]
                    squared = step * step + gap * gap
                    if abs(gap) <= reach and squared < best:
                        best, found = squared, (row + gap) * columns + at
            source[row, column] = found
