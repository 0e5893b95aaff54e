"""A beam against finite elements: the difference, and its physical part.

A beam's section warps and contracts freely; a rigid face prevents it.  The ends of a
solid link are therefore stiffer than the beam, by about what a beam shorter by a fixed
share of its radius would be: K / K_beam = 1 + c r / L, whose c depends on the section
and on Poisson's ratio only.  It vanishes as the link grows slender; a difference that
does not vanish is an error of one of the two models.

The commonest one is a section whose width and height are swapped, or a missing ``up``:
the beam is then turned about its own axis.  The beam is therefore also compared at
turns of 90 degrees, and a turn with much better agreement is reported.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forcefit.inputs.table import BadInput
from forcefit.results.display import html_table, short_repr
from stiffness.link import LinkStiffness, scaled
from stiffness.screws import rotation_matrix, screw_map

_MUCH_BETTER = 0.25  # largest share of the difference that a better turn leaves
_TURNS = (90, 180, 270)  # [deg]


@dataclass(frozen=True, eq=False)
class LinkComparison:
    """One link by a beam formula and by finite elements.

    Attributes:
        beam: by the formula.
        fea: by finite elements, same tip and axes.
        difference: (6, 6) [1] fea minus beam, scaled by sqrt(K_ii K_jj) of the beam.
        length: [m] base to tip, along the beam.
        size: [m] of the section: radius of gyration times 2, the radius of a round bar.
    """

    beam: LinkStiffness
    fea: LinkStiffness
    difference: NDArray
    length: float
    size: float

    __repr__, _repr_html_ = short_repr, html_table

    @property
    def slenderness(self) -> float:
        """Length over the section's size, L / r."""
        return self.length / self.size

    @property
    def end_effect(self) -> NDArray:
        """(6,) [1] c of ``K_ii / K_ii of the beam = 1 + c r / L``."""
        return np.diag(self.difference) * self.slenderness

    @property
    def better_turn(self) -> tuple[int, float]:
        """The turn of the beam about base to tip that agrees much better.

        Its angle [deg], 0 if there is none, and the largest remaining difference [1].
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
        # of turns that differ by mesh error and rounding only, the smallest
        least = min(remaining.values()) + noise + 1e-9 * worst
        best = min(angle for angle in remaining if remaining[angle] <= least)
        better = remaining[best] < _MUCH_BETTER * worst and worst > noise
        return (best, remaining[best]) if better else (0, worst)

    @property
    def explanation(self) -> str:
        """The difference in words."""
        angle, remaining = self.better_turn
        if angle:
            worst = 100 * np.abs(self.difference).max()
            swap = "" if angle == 180 else ", or width and height swapped"
            return (
                f"The beam's axes look swapped: turned by {angle} degrees about base "
                f"to tip it would differ by {100 * remaining:.3g} % at most, not "
                f"{worst:.3g} %.  Expected another up{swap}."
            )
        c = self.end_effect
        noise = self.fea.relative_error_estimate * self.slenderness
        turns, shifts = (" ".join(f"{v:.2f}" for v in part) for part in (c[:3], c[3:]))
        chord = float(np.linalg.norm(self.fea.tip - self.fea.base))
        bent = (
            "  A solid's corner is stiffer than two beams that meet in a point: c "
            "includes more than the end effect."
        )
        return (
            f"L / r = {self.slenderness:.3g}.  Held faces cannot warp or shrink: "
            f"K / K_beam = 1 + c r / L with c = {turns} (rotations), {shifts} "
            f"(translations); the mesh error changes c by up to {noise:.2f}."
            f"{bent if self.length > 1.001 * chord else ''}"
        )


def _turned_difference(comparison: LinkComparison, rotation: NDArray) -> float:
    """Return [1] largest difference from the beam turned about the tip by a vector."""
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
    """Compare two stiffnesses of one link.

    Args:
        beam: by formula.
        fea: by finite elements, read at the same tip in the same axes.
        size: [m] of the section, the radius of a round bar.
        length: [m] of the beam; from base to tip if absent.

    Returns:
        The comparison.

    Raises:
        BadInput: the two tips are further apart than 1e-6 m and 0.1 % of the length.
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
    """Return upper entries of a stiffness above a thousandth of their scale.

    Args:
        stiffness: (6, 6).

    Returns:
        Rows and columns.
    """
    matters = np.abs(np.triu(scaled(stiffness, stiffness))) > 1e-3
    return [(int(i), int(j)) for i, j in zip(*np.nonzero(matters), strict=True)]
