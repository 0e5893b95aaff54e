"""Columns of cones sorted into layers, and sums over the cones, compiled.

The first layer has the first column of every cone, the second the second of every cone
that has one, and so on, the largest cones first: loops over the cones run along a
layer, several cones at once in the processor's vector registers.
"""

from numpy.typing import NDArray

from assembly.solvers.compiled import kernel, part
from assembly.solvers.layouts import GivenIndices, Indices
from assembly.solvers.vectors import indices

LANES = 16  # rows are padded with zeros to a multiple of it
FAST = {"contract", "reassoc", "nsz", "arcp"}


@part
def layers_of(starts: GivenIndices) -> tuple[Indices, Indices]:
    """Columns sorted into layers, the largest cones first.

    Args:
        starts: (cones + 1,) first column of each cone, and nu.

    Returns:
        (nu,) column at each place; (widest + 1,) first place of each layer, and nu.
    """
    cones, widest = len(starts) - 1, 0
    for c in range(cones):
        widest = max(widest, starts[c + 1] - starts[c])
    order, layers = indices(starts[-1]), indices(widest + 1)
    place = 0
    for layer in range(widest):
        layers[layer] = place
        for size in range(widest, layer, -1):
            for c in range(cones):
                if starts[c + 1] - starts[c] == size:
                    order[place] = starts[c] + layer
                    place += 1
    layers[widest] = place
    return order, layers


@kernel(fastmath=FAST)
def dot(a: NDArray, b: NDArray) -> float:
    """Inner product of two rows, fast where they are padded to a multiple of LANES.

    Args:
        a: (width,).
        b: (width,).

    Returns:
        a.b.
    """
    total = 0.0
    for j in range(len(a)):
        total += a[j] * b[j]
    return total


@kernel(fastmath=FAST)
def add(weight: float, row: NDArray, total: NDArray) -> None:
    """Add a multiple of a row.

    Args:
        weight: which multiple.
        row: (width,).
        total: (width,) incremented in place.
    """
    for j in range(len(total)):
        total[j] += weight * row[j]


@kernel(fastmath=FAST)
def cone_sums(layers: NDArray, a: NDArray, b: NDArray, total: NDArray) -> None:
    """Inner products of a's and b's parts in every cone."""
    for c in range(len(total)):
        total[c] = 0.0
    for layer in range(len(layers) - 1):
        x, y = (
            a[layers[layer] : layers[layer + 1]],
            b[layers[layer] : layers[layer + 1]],
        )
        for c in range(len(x)):
            total[c] += x[c] * y[c]
