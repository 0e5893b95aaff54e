"""Comparison of beam theory with finite elements, with the cause of the difference.

The section of a beam warps and contracts freely, whereas a rigid face prevents both, so
the ends of a solid link are stiffer than those of the beam. The solid is as stiff as a
beam that is shorter by a fixed multiple of the section size r: K / K_beam = 1 + c r /
L. The coefficient c depends only on the section and on Poisson's ratio. The difference
vanishes as the link becomes slender; if it does not, one of the two models is wrong.

The most common mistake is to swap width and height of the section, or to omit ``up``,
so that the beam is rotated about its axis. Rotations of the beam by multiples of 90
degrees are therefore compared too, and one that agrees much better is reported.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forcefit.inputs.table import BadInput
from forcefit.results.display import html_table, short_repr
from forcefit.stiffness.link import LinkStiffness, scaled
from forcefit.stiffness.screws import rotation_matrix, screw_map

# largest difference after a reported rotation, relative to the difference before it
_MUCH_BETTER = 0.25
_TURNS = (90, 180, 270)  # [deg] trial rotations of the beam about its axis


@dataclass(frozen=True, eq=False)
class LinkComparison:
    """A link computed both by a beam formula and by finite elements.

    Attributes:
        beam: link by the beam formula.
        fea: link by finite elements, with the same tip and axes.
        difference: (6, 6) [1] fea minus beam, scaled by sqrt(K_ii K_jj) of the beam.
        length: [m] length from base to tip along the beam.
        size: [m] section size: twice the radius of gyration, which is the radius of a
            round bar.
    """

    beam: LinkStiffness
    fea: LinkStiffness
    difference: NDArray
    length: float
    size: float

    __repr__, _repr_html_ = short_repr, html_table

    @property
    def slenderness(self) -> float:
        """Ratio L / r of the length to the section size."""
        return self.length / self.size

    @property
    def end_effect(self) -> NDArray:
        """(6,) [1] coefficient c in ``K_ii / K_ii of the beam = 1 + c r / L``."""
        return np.diag(self.difference) * self.slenderness

    @property
    def better_turn(self) -> tuple[int, float]:
        """Rotation of the beam about the line from base to tip that agrees much better.

        Returns the angle [deg], or 0 if no rotation agrees much better, and the largest
        remaining difference [1].
        """
        worst = float(np.abs(self.difference).max())
        axis = self.fea.tip - self.fea.base
        if not np.linalg.norm(axis) > 0:
            return 0, worst
        remaining = {
            angle: _turned_difference(self, np.radians(angle) * axis)
            for angle in _TURNS
        }
        noise = 2 * self.fea.relative_error_estimate
        # of several rotations that differ only by mesh error and round-off, use the
        # smallest
        least = min(remaining.values()) + noise + 1e-9 * worst
        best = min(angle for angle in remaining if remaining[angle] <= least)
        better = remaining[best] < _MUCH_BETTER * worst and worst > noise
        return (best, remaining[best]) if better else (0, worst)

    @property
    def explanation(self) -> str:
        """Text that explains the difference."""
        angle, remaining = self.better_turn
        if angle:
            worst = 100 * np.abs(self.difference).max()
            swap = "" if angle == 180 else ", or exchanged width and height"
            return (
                f"The beam's axes seem to be exchanged: rotated by {angle} degrees "
                "about base "
                f"to tip it would differ by {100 * remaining:.3g} % at most, not "
                f"{worst:.3g} %.  Expected another up{swap}."
            )
        c = self.end_effect
        noise = self.fea.relative_error_estimate * self.slenderness
        turns, shifts = (" ".join(f"{v:.2f}" for v in part) for part in (c[:3], c[3:]))
        chord = float(np.linalg.norm(self.fea.tip - self.fea.base))
        bent = (
            "  The corner of a solid is stiffer than two beams that meet at a point, "
            "so c includes more than the end effect."
        )
        return (
            f"L / r = {self.slenderness:.3g}.  Held faces cannot warp or shrink: "
            f"K / K_beam = 1 + c r / L with c = {turns} (rotations), {shifts} "
            f"(translations); the mesh error changes c by up to {noise:.2f}."
            f"{bent if self.length > 1.001 * chord else ''}"
        )


def _turned_difference(comparison: LinkComparison, rotation: NDArray) -> float:
    """Compute the largest difference [1] after rotating the beam about its tip."""
    axis = rotation / np.linalg.norm(comparison.fea.tip - comparison.fea.base)
    A = screw_map(np.zeros(3), rotation_matrix(axis))
    K = A @ comparison.beam.stiffness @ A.T
    return float(np.abs(scaled(comparison.fea.stiffness - K, K)).max())


def compare_link(
    beam: LinkStiffness,
    fea: LinkStiffness,
    size: float,
    length: float | None = None,
) -> LinkComparison:
    """Compare the stiffness of a link by beam theory and by finite elements.

    Args:
        beam: link by the beam formula.
        fea: link by finite elements, with the same tip and axes.
        size: [m] section size; the radius of a round bar.
        length: [m] length of the beam; by default from base to tip.

    Returns:
        The comparison.

    Raises:
        BadInput: the distance between the tips exceeds 1e-6 m and 0.1 % of the length.
    """
    length = float(np.linalg.norm(fea.tip - fea.base)) if length is None else length
    gap = float(np.linalg.norm(fea.tip - beam.tip))
    if gap > 1e-6 + 1e-3 * length:
        ends = [", ".join(f"{v:.6g}" for v in link.tip) for link in (beam, fea)]
        raise BadInput(
            f"compare: the beam ends at ({ends[0]}) m, the tip of the surface "
            f"is at ({ends[1]}) m; expected the same point: change the beam or "
            "--base and --tip"
        )
    difference = scaled(fea.stiffness - beam.stiffness, beam.stiffness)
    return LinkComparison(beam, fea, difference, length, size)


def entries_that_matter(stiffness: NDArray) -> list[tuple[int, int]]:
    """Find the upper entries of a stiffness above a thousandth of their scale.

    Args:
        stiffness: (6, 6) stiffness.

    Returns:
        Rows and columns of these entries.
    """
    matters = np.abs(np.triu(scaled(stiffness, stiffness))) > 1e-3
    return [(int(i), int(j)) for i, j in zip(*np.nonzero(matters), strict=True)]
