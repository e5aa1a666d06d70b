"""Sparse factors of the islands' matrices: L D L' by QDLDL, which has no threads and calls no BLAS, so its
bits are its own.

Source: Stellato et al., OSQP: an operator splitting solver for quadratic programs, 2020 (QDLDL; ordering by
AMD).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.deform.blocks import Pattern
from weathercoat.mesh.surface import Indices, Vectors

Numbers = NDArray[np.integer]


class Factors:
    """Factors of a block-diagonal matrix, one for each island.

    The unknowns of island i are bounds[i]:bounds[i + 1]. A pattern is ordered when its island is first
    factored; with other values later, it is factored in the same order.
    """

    def __init__(self, pattern: Pattern, bounds: Numbers, size: int) -> None:
        """For blocks of size x size."""
        self._size, self._bounds, self._pattern = size, bounds, pattern
        blocks = np.diff(pattern.start)
        entries = size * (np.repeat(blocks, size) - 1) + np.tile(np.arange(1, size + 1), len(blocks))
        self._start = np.concatenate([[0], np.cumsum(entries)])
        self._row = np.empty(self._start[-1], np.int64)
        _expand_rows(size, pattern.start, pattern.row, self._start, self._row)
        self._matrices: dict[int, Any] = {}
        self._solvers: dict[int, Any] = {}

    def factor(self, islands: Numbers, blocks: Vectors) -> None:
        """Factor the matrices of islands from all blocks (b, size, size); only upper triangles are read.

        One that has no factors is remembered as such: its solutions are NaN.
        """
        import qdldl

        data = np.empty(len(self._row))
        _expand_blocks(self._size, self._pattern.start, self._start, blocks, data)
        for i in islands.tolist():
            matrix = self._matrix(i, data)
            try:
                if self._solvers.get(i) is None:
                    self._solvers[i] = qdldl.Solver(matrix, upper=True)
                else:
                    self._solvers[i].update(matrix, upper=True)
            except RuntimeError:  # a pivot is 0
                self._solvers[i] = None

    def _matrix(self, island: int, data: Vectors) -> Any:
        """The upper triangle of an island, from the values of all; one object, since its checks take long."""
        from scipy.sparse import csc_matrix

        first, last = self._size * self._bounds[island], self._size * self._bounds[island + 1]
        begin, end = self._start[first], self._start[last]
        if island not in self._matrices:
            rows, starts = self._row[begin:end] - first, self._start[first : last + 1] - begin
            self._matrices[island] = csc_matrix(
                (data[begin:end], rows.astype(np.int32), starts.astype(np.int32)),
                shape=(last - first, last - first),
            )
        else:
            self._matrices[island].data[:] = data[begin:end]
        return self._matrices[island]

    def is_positive(self, island: int) -> bool:
        """Whether the matrix of an island that has been factored is positive definite."""
        solver = self._solvers[island]
        return solver is not None and bool((solver.factors()[1] > 0.0).all())

    def solve(self, islands: Numbers, right: Vectors) -> Vectors:
        """Solve for the unknowns of islands that have been factored; right (v, size), zeros elsewhere."""
        out = np.zeros_like(right)
        for i in islands.tolist():
            part = slice(self._bounds[i], self._bounds[i + 1])
            solver = self._solvers[i]
            out[part] = (
                np.nan if solver is None else solver.solve(right[part].reshape(-1)).reshape(-1, self._size)
            )
        return out


@kernel
def _expand_rows(size: int, block_start: Indices, block_row: Indices, start: Indices, row: Indices) -> None:
    """The rows of scalar columns, `size` for each column of blocks; the upper triangle."""
    for j in range(len(block_start) - 1):
        for c in range(size):
            at = start[size * j + c]
            for b in range(block_start[j], block_start[j + 1]):
                for r in range(size if block_row[b] < j else c + 1):
                    row[at] = size * block_row[b] + r
                    at += 1


@kernel
def _expand_blocks(size: int, block_start: Indices, start: Indices, blocks: Vectors, data: Vectors) -> None:
    """The values of scalar columns from blocks."""
    for j in range(len(block_start) - 1):
        last = block_start[j + 1] - 1
        for c in range(size):
            at = start[size * j + c]
            for b in range(block_start[j], last + 1):
                for r in range(size if b < last else c + 1):
                    data[at] = blocks[b, r, c]
                    at += 1
