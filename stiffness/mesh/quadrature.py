"""Quadrature rules on the reference triangle and tetrahedron.

A quadrature point is written as one letter for each barycentric coordinate, such as
``aab`` for the point (a, a, b). Points with the same letters have the same weight. All
weights are positive, so that the integral of a positive energy density is positive.

Sources: Hammer and Stroud (1956) for degree 2; Radon (1948) for 5 and Dunavant (1985)
for 4 and 6 in the triangle; Keast (1986) for 4, 5 and 6 in the tetrahedron.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class _Rule(NamedTuple):
    """A quadrature rule that is exact for polynomials up to a given degree.

    Attributes:
        degree: largest degree of polynomials that are integrated exactly.
        points: letters of each group of points, such as ``aab``.
        coordinates: values of the letters a, b, c, in this order.
        weights: weight of each group of points with the same letters.
    """

    degree: int
    points: str
    coordinates: tuple[float, ...]
    weights: dict[str, float]


_TRIANGLE = (
    _Rule(2, "abb bab bba", (2 / 3, 1 / 6), {"abb": 1 / 6}),
    _Rule(
        4, "aab ccd aba cdc baa dcc",
        (0.445948490915965, 0.10810301816807, 0.091576213509771, 0.816847572980459),
        {"aab": 0.111690794839006, "ccd": 0.054975871827661},
    ),
    _Rule(
        5, "aaa bbc dde bcb ded cbb edd",
        (
            1 / 3, 0.470142064105115, 0.05971587178977,
            0.101286507323456, 0.797426985353087,
        ),
        {"aaa": 9 / 80, "bbc": 0.066197076394253, "dde": 0.0629695902724135},
    ),
    _Rule(
        6, "aab ccd aba cdc baa dcc efg feg fge egf gef gfe",
        (
            0.24928674517091, 0.501426509658179, 0.063089014491502, 0.873821971016996,
            0.310352451033784, 0.636502499121399, 0.053145049844817,
        ),
        {
            "aab": 0.0583931378631895, "ccd": 0.0254224531851035,
            "efg": 0.041425537809187,
        },
    ),
)  # fmt: skip
_TETRAHEDRON = (
    _Rule(1, "aaaa", (1 / 4,), {"aaaa": 1 / 6}),
    _Rule(
        2, "abaa baaa aaab aaba", (0.1381966011250105, 0.5854101966249685),
        {"aaab": 1 / 24},
    ),
    _Rule(
        4, "aabb abab abba bbaa baba baab cdcc dccc cccd ccdc efee feee eeef eefe",
        (
            0.0, 0.5, 0.1005267652252045, 0.6984197043243866,
            0.3143728734931922, 0.0568813795204234,
        ),
        {
            "aabb": 0.003174603174603167, "cccd": 0.014764970790496783,
            "eeef": 0.022139791114265117,
        },
    ),
    _Rule(
        5, "aaaa bcbb cbbb bbbc bbcb dedd eddd ddde dded ffgg fgfg fggf ggff gfgf gffg",
        (
            1 / 4, 1 / 3, 0.0, 0.0909090909090909, 0.7272727272727273,
            0.4334498464263357, 0.0665501535736643,
        ),
        {
            "aaaa": 0.030283678097089182, "bbbc": 0.006026785714285717,
            "ddde": 0.011645249086028967, "ffgg": 0.010949141561386449,
        },
    ),
    _Rule(
        6, "abaa baaa aaab aaba cdcc dccc cccd ccdc efee feee eeef eefe "
        "ghii gihi giih hgii higi hiig iihg ihgi igih iigh ihig ighi",
        (
            0.2146028712591517, 0.3561913862225449, 0.0406739585346113,
            0.8779781243961660, 0.3223378901422757, 0.0329863295731731,
            0.6030056647916491, 0.2696723314583159, 0.0636610018750175,
        ),
        {
            "aaab": 0.0066537917096946494, "cccd": 0.0016795351758867834,
            "eeef": 0.009226196923942399, "ghii": 0.008035714285714283,
        },
    ),
)  # fmt: skip


@lru_cache(maxsize=16)
def quadrature(degree: int, corners: int = 4) -> tuple[NDArray, NDArray]:
    """Return a quadrature rule that is exact for polynomials up to a given degree.

    Args:
        degree: degree of the polynomials, at most 6.
        corners: 4 for a tetrahedron, 3 for a triangle.

    Returns:
        Barycentric coordinates, (q, corners), and weights, (q,), whose sum is the area
        or volume of the reference element.

    Raises:
        ValueError: no rule of this degree is available.
    """
    rules = _TETRAHEDRON if corners == 4 else _TRIANGLE
    rule = next((r for r in rules if r.degree >= degree), None)
    if rule is None:
        raise ValueError(f"degree: found {degree}, expected at most {rules[-1].degree}")
    words = rule.points.split()
    letters = np.array([[ord(c) - ord("a") for c in word] for word in words])
    L = np.array(rule.coordinates)[letters]
    L[:, 0] = 1 - L[:, 1:].sum(axis=1)  # corrects round-off of the tabulated values
    return L, np.array([rule.weights["".join(sorted(word))] for word in words])
