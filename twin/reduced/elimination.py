"""Solution of the linear system of two planes: chains of elements, hinges, and a border that both hold."""

from twin.mechanics.compiled import compiled, inlined
from twin.reduced.chain import Array

NEAR = 3
"""Unknowns after its own that a row of an element holds: its neighbour, and the next element of both."""


@compiled
def eliminate(matrix: Array, right: Array, elements: int, hinges: int) -> None:
    """Solve a linear system in place, without pivots: the solution is in `right`.

    Elements hold the next `NEAR` alone, hinges their neighbour and elements, and all of them the unknowns of
    the border: the work grows with their number, and not with its third power.

    Args:
        matrix: (N, N), rewritten: elements, hinges, border.
        right: (N,) right side; rewritten.
        elements: number of their unknowns.
        hinges: number of their unknowns, two side by side.
    """
    count, border = len(right), elements + hinges
    for k in range(count):
        near = _near(k, elements, hinges, count)
        far = max(near, border)
        for row in range(k + 1, near):
            _reduce(matrix, right, row, k, near, far)
        if k < elements:
            for row in range(elements, border):
                _reduce(matrix, right, row, k, near, far)
        for row in range(far, count):
            _reduce(matrix, right, row, k, near, far)
    for k in range(count - 1, -1, -1):
        near = _near(k, elements, hinges, count)
        total = right[k]
        for column in range(k + 1, near):
            total -= matrix[k, column] * right[column]
        for column in range(max(near, border), count):
            total -= matrix[k, column] * right[column]
        right[k] = total / matrix[k, k]


@inlined
def _reduce(matrix: Array, right: Array, row: int, k: int, near: int, far: int) -> None:
    """Subtract from a row what removes its unknown k: of row k, columns below `near` and from `far` on."""
    if matrix[row, k] == 0.0:
        return
    ratio = matrix[row, k] / matrix[k, k]
    for column in range(k + 1, near):
        matrix[row, column] -= ratio * matrix[k, column]
    for column in range(far, len(right)):
        matrix[row, column] -= ratio * matrix[k, column]
    right[row] -= ratio * right[k]


@inlined
def _near(k: int, elements: int, hinges: int, count: int) -> int:
    """Return the end of the unknowns that row k holds before those of the border."""
    if k < elements:
        return min(k + 1 + NEAR, elements)
    if k < elements + hinges:
        return k + 2 - (k - elements) % 2
    return count
