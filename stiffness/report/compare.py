"""Comparison of a link stiffness by beam theory and by finite elements.

In beam theory, the section can warp and contract freely. In a solid link, rigid
interfaces prevent this, so the link is stiffer near its ends. This end effect is K /
K_beam = 1 + c r / L, where r is the section size and L the length. The coefficient c
depends on the section and on Poisson's ratio. For a slender link, both stiffnesses
agree, unless one of the two models is wrong.

If the user exchanges width and height of the section, the beam is rotated about its
axis. The comparison is therefore repeated for the beam rotated by multiples of 90
degrees. A rotation is reported if the agreement is much better.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forcefit.inputs.table import BadInput
from forcefit.results.display import html_table, short_repr
from forcefit.stiffness.link import LinkStiffness, scaled
from forcefit.stiffness.screws import rotation_matrix, screw_map

# largest ratio of the differences after and before a reported rotation
_MUCH_BETTER = 0.25
_TURNS = (90, 180, 270)  # [deg] compared rotations of the beam about its axis


@dataclass(frozen=True, eq=False)
class LinkComparison:
    """The stiffness of a link by beam theory and by finite elements.

    Attributes:
        beam: link by beam theory.
        fea: link by finite elements, with the same tip and the same axes.
        difference: (6, 6) [1] stiffness of ``fea`` minus stiffness of ``beam``, divided
            by sqrt(K_ii K_jj) of the beam.
        length: [m] length of the beam.
        size: [m] section size: twice the radius of gyration, which is the radius of a
            solid round bar.
    """

    beam: LinkStiffness
    fea: LinkStiffness
    difference: NDArray
    length: float
    size: float

    __repr__, _repr_html_ = short_repr, html_table

    @property
    def slenderness(self) -> float:
        """Ratio L / r of length and section size."""
        return self.length / self.size

    @property
    def end_effect(self) -> NDArray:
        """Coefficient c of the end effect for each diagonal entry, (6,)."""
        return np.diag(self.difference) * self.slenderness

    @property
    def better_turn(self) -> tuple[int, float]:
        """Rotation of the beam about its axis with a much better agreement.

        The values are the angle [deg], or 0 if there is no such rotation, and the
        largest difference after the rotation.
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
        # if the differences of several rotations are equal within mesh error and
        # round-off, the smallest rotation is reported
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
            swap = "" if angle == 180 else ", or exchange width and height"
            return (
                "The axes of the beam seem to be exchanged. After a rotation by "
                f"{angle} degrees about the line from base to tip, the largest "
                f"difference would be {100 * remaining:.3g} % in place of {worst:.3g} "
                f"%.  Change up{swap}."
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
            f"L / r = {self.slenderness:.3g}.  Rigid faces cannot warp or contract: K "
            f"/ K_beam = 1 + c r / L with c = {turns} (rotations), {shifts} "
            "(translations); the mesh error changes c by up to "
            f"{noise:.2f}.{bent if self.length > 1.001 * chord else ''}"
        )


def _turned_difference(comparison: LinkComparison, rotation: NDArray) -> float:
    """Compute the largest difference after a rotation of the beam about its axis."""
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
    """Compare the stiffnesses of a link by beam theory and by finite elements.

    Args:
        beam: link by beam theory.
        fea: link by finite elements, with the same tip and the same axes.
        size: [m] section size, which is the radius of a solid round bar.
        length: [m] length of the beam. The default is the distance from base to tip.

    Returns:
        The comparison.

    Raises:
        BadInput: the distance between the two tips exceeds 1e-6 m and 0.1 % of the
            length.
    """
    length = float(np.linalg.norm(fea.tip - fea.base)) if length is None else length
    gap = float(np.linalg.norm(fea.tip - beam.tip))
    if gap > 1e-6 + 1e-3 * length:
        ends = [", ".join(f"{v:.6g}" for v in link.tip) for link in (beam, fea)]
        raise BadInput(
            f"compare: the tip of the beam is at ({ends[0]}) m, but the tip "
            f"interface of the surface is at ({ends[1]}) m; expected the same "
            "point; change the beam, or --base and --tip"
        )
    difference = scaled(fea.stiffness - beam.stiffness, beam.stiffness)
    return LinkComparison(beam, fea, difference, length, size)


def entries_that_matter(stiffness: NDArray) -> list[tuple[int, int]]:
    """Find the significant entries in the upper triangle of a stiffness.

    Args:
        stiffness: (6, 6) stiffness.

    Returns:
        Rows and columns of the entries with an absolute value above sqrt(K_ii K_jj) /
        1000.
    """
    matters = np.abs(np.triu(scaled(stiffness, stiffness))) > 1e-3
    return [(int(i), int(j)) for i, j in zip(*np.nonzero(matters), strict=True)]
