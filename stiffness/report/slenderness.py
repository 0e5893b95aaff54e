r"""Comparison of beam theory and finite elements over slenderness.

Near a rigid interface, the section cannot warp or contract. The extent of this end
effect does not depend on the length L of the link. With the section size r, the ratio
of the stiffnesses is

    K / K_beam = 1 + c r / L + d (r / L)^2.

The coefficients c and d depend on the section, the interfaces and Poisson's ratio. They
are fitted to the stiffnesses of links with the same section and different lengths. The
residual of the fit should not exceed the mesh errors.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forcefit.inputs.table import BadInput
from forcefit.results.display import html_table, short_repr
from forcefit.stiffness.beam.beam import beam_compliance
from forcefit.stiffness.beam.sections import declared_section
from forcefit.stiffness.link import LinkStiffness
from forcefit.stiffness.report.compare import LinkComparison, compare_link
from forcefit.stiffness.surface.beam_surfaces import shape_surface

_SHAPES = {
    frozenset({"radius"}): "round",
    frozenset({"radius", "inner_radius"}): "tube",
    frozenset({"width", "height"}): "rectangle",
    frozenset({"width", "height", "wall"}): "box",
}


@dataclass(frozen=True, eq=False)
class SlendernessSweep:
    """Comparisons for a section at several lengths, and the fitted end effect.

    Attributes:
        comparisons: comparisons of beam theory and finite elements, shortest link
            first.
        end_effect: (6, 6) [1] fitted coefficient c of each entry.
        end_effect_error: (6, 6) [1] error of c due to the estimated mesh errors.
        second: (6, 6) [1] fitted coefficient d of each entry.
        residual: (n, 6, 6) [1] residual of the fit at each length.
    """

    comparisons: tuple[LinkComparison, ...]
    end_effect: NDArray
    end_effect_error: NDArray
    second: NDArray
    residual: NDArray

    __repr__, _repr_html_ = short_repr, html_table

    @property
    def slenderness(self) -> NDArray:
        """Slenderness L / r of each comparison, (n,)."""
        return np.array([c.slenderness for c in self.comparisons])

    @property
    def explanation(self) -> str:
        """Text that explains the end effect."""
        c, error = np.diag(self.end_effect), np.diag(self.end_effect_error)
        turns, shifts = (" ".join(f"{v:.3f}" for v in part) for part in (c[:3], c[3:]))
        left = 100 * np.abs(self.residual).max()
        mesh = 100 * max(k.fea.relative_error_estimate for k in self.comparisons)
        return (
            "Rigid faces cannot warp or contract: K / K_beam = 1 + c r / L + d (r / "
            f"L)^2 with c = {turns} (rotations), {shifts} (translations), +- "
            f"{error.max():.2g} due to the mesh errors.  The largest residual is "
            f"{left:.2g} %, and the estimated mesh error is {mesh:.2g} %."
        )


def sweep_slenderness(
    section: Mapping[str, float],
    E: float,
    nu: float,
    ratios: Sequence[float],
    *,
    accuracy: float = 0.002,
    interface: str = "rigid",
    update: Callable[[int, int], None] | None = None,
) -> SlendernessSweep:
    """Compare beam theory and finite elements for a section at several lengths.

    Args:
        section: dimensions [m] by name: ``radius`` and optionally ``inner_radius``, or
            ``width``, ``height`` and optionally ``wall``.
        E: [Pa] Young's modulus.
        nu: [-] Poisson's ratio.
        ratios: two or more values of L / r, where r is
            :attr:`forcefit.stiffness.beam.sections.Section.size`.
        accuracy: [1] largest accepted relative error of the finite element stiffness.
        interface: kind of the interfaces, one of ``KINDS``.
        update: callback that is called with the number of finished lengths and the
            number of all lengths.

    Returns:
        The comparisons with the fit.

    Raises:
        BadInput: the section is invalid, or fewer than two ratios are given.
    """
    from forcefit.stiffness.fem.fea import FemOptions, solve_link
    from forcefit.stiffness.fem.material import Material
    from forcefit.stiffness.surface.interface import parse_interface

    if frozenset(section) not in _SHAPES:
        raise BadInput(
            f"slenderness: found a section of {', '.join(section) or 'nothing'}; "
            "expected radius and optionally inner_radius, or width, height and "
            "optionally wall"
        )
    if len(ratios) < 2:
        raise BadInput("slenderness: found one length, expected two or more")
    constants = declared_section(section, nu)
    comparisons = []
    for done, ratio in enumerate(ratios, start=1):
        length = ratio * constants.size
        surface = shape_surface(
            _SHAPES[frozenset(section)], {**section, "length": length}
        )
        fea = solve_link(
            surface,
            parse_interface("z=0"),
            parse_interface(f"z={length!r}"),
            [Material(E, nu)],
            options=FemOptions(accuracy, interface),
        ).link
        C = beam_compliance(length, constants, E, nu, axis=[0, 0, 1], up=[0, 1, 0])
        beam = LinkStiffness("Timoshenko beam", C, tip=fea.tip, base=fea.base)
        comparisons.append(compare_link(beam, fea, constants.size))
        if update is not None:
            update(done, len(ratios))
    return fit_end_effect(comparisons)


def fit_end_effect(comparisons: Sequence[LinkComparison]) -> SlendernessSweep:
    """Fit c and d of K / K_beam = 1 + c r / L + d (r / L)^2.

    Args:
        comparisons: comparisons for a section at two or more lengths.

    Returns:
        The comparisons with the fit.
    """
    x = np.array([1 / c.slenderness for c in comparisons])
    terms = np.column_stack([x, x**2])
    values = np.array([c.difference for c in comparisons]).reshape(len(x), 36)
    errors = np.array([c.fea.relative_errors for c in comparisons]).reshape(len(x), 36)
    inverse = np.linalg.pinv(terms)
    fit = inverse @ values
    return SlendernessSweep(
        comparisons=tuple(comparisons),
        end_effect=fit[0].reshape(6, 6),
        end_effect_error=(np.abs(inverse[0]) @ errors).reshape(6, 6),
        second=fit[1].reshape(6, 6),
        residual=(values - terms @ fit).reshape(-1, 6, 6),
    )
