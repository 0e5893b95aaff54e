"""Results on link stiffnesses as plain values and as text."""

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from forcefit.results.text import in_unit, value_text
from forcefit.stiffness.link import LinkStiffness
from forcefit.stiffness.report.compare import LinkComparison, entries_that_matter
from forcefit.stiffness.screws import SCREW, WRENCH

if TYPE_CHECKING:
    from forcefit.stiffness.fem.stress import PeakStress
    from forcefit.stiffness.report.slenderness import SlendernessSweep


def link_results(link: LinkStiffness) -> dict[str, Any]:
    """Return the JSON object of a link.

    Args:
        link: a link.

    Returns:
        Dictionary of arrays and numbers in SI units.
    """
    results: dict[str, Any] = {
        "method": link.method,
        "screw": list(SCREW),
        "wrench": list(WRENCH),
        "stiffness": link.stiffness,
        "compliance": link.compliance,
        "tip": link.tip,
        "base": link.base,
        "relative_error_estimate": link.relative_error_estimate,
        "relative_errors": link.relative_errors,
        "mesh": dict(link.mesh),
    }
    if link.mass > 0:
        results["mass"] = link.mass
        results["center_of_mass"] = link.center_of_mass
        results["inertia"] = link.inertia
    return results


def comparison_results(comparison: LinkComparison) -> dict[str, Any]:
    """Return the JSON object of a comparison of beam and finite elements.

    Args:
        comparison: comparison of the two stiffnesses of a link.

    Returns:
        Dictionary with both links, the difference of each entry, and an explanation.
    """
    return {
        "beam": link_results(comparison.beam),
        "fea": link_results(comparison.fea),
        "difference": comparison.difference,
        "length": comparison.length,
        "slenderness": comparison.slenderness,
        "end_effect": comparison.end_effect,
        "axes_turned": comparison.better_turn[0],
        "explanation": comparison.explanation,
    }


def sweep_results(sweep: "SlendernessSweep") -> dict[str, Any]:
    """Return the JSON object of a sweep over slenderness.

    Args:
        sweep: comparisons of one section at several lengths.

    Returns:
        Dictionary with both stiffnesses at each length, their differences, and an
        explanation.
    """
    return {
        "size": sweep.comparisons[0].size,
        "slenderness": sweep.slenderness,
        "beam": [c.beam.stiffness for c in sweep.comparisons],
        "fea": [c.fea.stiffness for c in sweep.comparisons],
        "difference": [c.difference for c in sweep.comparisons],
        "relative_error_estimate": [
            c.fea.relative_error_estimate for c in sweep.comparisons
        ],
        "end_effect": sweep.end_effect,
        "end_effect_error": sweep.end_effect_error,
        "second": sweep.second,
        "residual": sweep.residual,
        "explanation": sweep.explanation,
    }


def stress_results(peak: "PeakStress") -> dict[str, Any]:
    """Return the JSON object of a peak stress.

    Args:
        peak: peak stress due to a wrench.

    Returns:
        Dictionary with stresses, their positions and the evaluated region.
    """
    results: dict[str, Any] = {
        "wrench": peak.wrench,
        "von_mises": peak.von_mises,
        "error": peak.error if math.isfinite(peak.error) else None,
        "place": peak.place,
        "region": peak.region,
        "away": peak.away,
    }
    if peak.beam is not None:
        results["beam"] = {
            "von_mises": peak.beam[0],
            "place": peak.beam[1],
            "von_mises_whole_length": peak.beam_whole,
        }
    return results


def link_text(link: LinkStiffness) -> str:
    """Format the stiffness of a link as text.

    Args:
        link: a link.

    Returns:
        Lines of text.
    """
    place = ", ".join(f"{v:g}" for v in link.tip)
    lines = [f"{link.method}; K at the tip ({place}) m [N m/rad, N/rad, N/m]"]
    lines += _matrix(link.stiffness, "{:14.6g}")
    if not link.mesh:
        return "\n".join(lines)
    mesh = link.mesh
    outcome = "reached" if mesh["reached"] else "NOT reached within the budget"
    lines += [
        f"largest relative error: {link.relative_error_estimate:.2g} (estimate); "
        f"the required {mesh['accuracy']:g} was {outcome}",
        f"mesh: {mesh['elements']} elements, {mesh['unknowns']} unknowns, "
        f"volume {mesh['volume']:.6g} m^3 (surface {mesh['surface_volume']:.6g}), "
        f"{'closed' if mesh['closed'] else 'OPEN'}, "
        f"{mesh['meshes']} mesh{'es' if mesh['meshes'] > 1 else ''}, "
        f"{mesh['solver']}, {mesh['seconds']:.1f} s",
        f"elements: quality {mesh['worst_quality']:.2f} at worst, "
        f"{mesh['mean_quality']:.2f} on average (1 for a regular tetrahedron); angles "
        f"between faces {math.degrees(mesh['smallest_angle']):.0f} to "
        f"{math.degrees(mesh['largest_angle']):.0f} degrees; boundary "
        f"{mesh['area']:.6g} m^2 (surface {mesh['surface_area']:.6g})",
    ]
    if mesh.get("flat_elements"):
        lines.append(
            f"WARNING: {mesh['flat_elements']} elements are nearly flat "
            "(quality below 0.01): the surface has details much smaller than "
            "its walls, or facets that are not smooth"
        )
    if mesh.get("drawn_out"):
        lines.append("the section of the bar was extruded, so its elements are long")
    lines += [f"repaired: {repair}" for repair in mesh["repairs"]]
    if link.mass > 0:
        center = ", ".join(f"{v:.5g}" for v in link.center_of_mass)
        lines.append(f"mass {link.mass:.5g} kg, centre ({center}) m")
    return "\n".join(lines)


def comparison_text(comparison: LinkComparison) -> str:
    """Format a comparison of beam and finite elements as text.

    Args:
        comparison: comparison of the two stiffnesses of a link.

    Returns:
        Lines of text.
    """
    lines = [
        link_text(comparison.beam),
        "",
        link_text(comparison.fea),
        "",
        "finite elements minus beam, scaled by sqrt(K_ii K_jj) of the beam [%]",
        *_matrix(100 * comparison.difference, "{:14.3f}"),
        "",
        comparison.explanation,
    ]
    return "\n".join(lines)


def sweep_text(sweep: "SlendernessSweep") -> str:
    """Format a sweep over slenderness as text.

    Args:
        sweep: comparisons of one section at several lengths.

    Returns:
        Lines of text.
    """
    entries = entries_that_matter(sweep.comparisons[0].beam.stiffness)
    names = [SCREW[i] if i == j else f"{SCREW[i]} {SCREW[j]}" for i, j in entries]
    lines = [
        "finite elements minus beam, scaled by sqrt(K_ii K_jj) of the beam [%]",
        "   L / r" + "".join(f"{name:>10}" for name in names) + "  mesh error",
    ]
    for ratio, c in zip(sweep.slenderness, sweep.comparisons, strict=True):
        values = "".join(f"{100 * c.difference[entry]:10.3f}" for entry in entries)
        mesh = 100 * c.fea.relative_error_estimate
        lines.append(f"{ratio:8.4g}{values}{mesh:12.2g}")
    c_values = "".join(f"{sweep.end_effect[entry]:10.3f}" for entry in entries)
    errors = "".join(f"{sweep.end_effect_error[entry]:10.2g}" for entry in entries)
    lines += [f"       c{c_values}", f"      +-{errors}", "", sweep.explanation]
    return "\n".join(lines)


def stress_text(peak: "PeakStress") -> str:
    """Format a peak stress as text.

    Args:
        peak: peak stress due to a wrench.

    Returns:
        Lines of text.
    """
    lines = [
        f"largest von Mises stress {_megapascals(peak.von_mises, peak.place)}",
        f"estimated error of the mesh: {_stress_error(peak)}",
        f"evaluated region: {peak.region}",
    ]
    if peak.beam is not None:
        lines += [
            f"beam, same region: {_megapascals(*peak.beam)}",
            f"beam, whole length: {value_text('von_mises', peak.beam_whole)}",
        ]
    return "\n".join(lines)


def _stress_error(peak: "PeakStress") -> str:
    """Format the estimated error of a stress."""
    if not math.isfinite(peak.error):
        return (
            "none, because the peak is on an inner edge, where the elastic stress is "
            "infinite"
        )
    share = peak.error / peak.von_mises if peak.von_mises else 0.0
    return f"{in_unit(peak.error, 'MPa', 2)} ({100 * share:.2g} %)"


def _megapascals(stress: float, place: NDArray) -> str:
    """Format a stress and its position as text."""
    where = ", ".join(f"{v:.4g}" for v in np.where(np.abs(place) < 1e-9, 0, place))
    return f"{value_text('von_mises', stress)} at ({where}) m"


def matrix_text(stiffness: NDArray) -> str:
    """Format a stiffness as text with names of rows and columns.

    Args:
        stiffness: (6, 6) stiffness.

    Returns:
        Lines of text.
    """
    return "\n".join(_matrix(stiffness, "{:14.6g}"))


def _matrix(matrix: NDArray, form: str) -> list[str]:
    """Format a 6 by 6 matrix as lines of text. Round-off is shown as zero."""
    head = "   " + "".join(f"{name:>14}" for name in SCREW)
    noise = 1e-12 * np.abs(matrix).max()
    rows = np.where(np.abs(matrix) < noise, 0.0, matrix)
    body = [
        f"{name} " + "".join(form.format(v) for v in row)
        for name, row in zip(WRENCH, rows, strict=True)
    ]
    return [head, *body]
