"""A link's stiffness as plain values for a file, and as text for a reader."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from stiffness.compare import Comparison
from stiffness.link import LinkStiffness
from stiffness.screws import SCREW, WRENCH


def link_results(link: LinkStiffness) -> dict[str, Any]:
    """The object that ``--json`` writes for one link.

    Args:
        link: a link.

    Returns:
        Arrays and numbers in SI units under the keys of the public format.
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


def comparison_results(comparison: Comparison) -> dict[str, Any]:
    """The object that ``--json`` writes for a beam beside finite elements.

    Args:
        comparison: of one link by two methods.

    Returns:
        Both links, their difference entry by entry, and what explains it.
    """
    return {
        "beam": link_results(comparison.beam),
        "fea": link_results(comparison.fea),
        "difference": comparison.difference,
        "length": comparison.length,
        "slenderness": comparison.slenderness,
        "end_effect": comparison.end_effect,
        "explanation": comparison.explanation,
    }


def link_text(link: LinkStiffness) -> str:
    """A link for a reader: its stiffness, how good it is, its mesh.

    Args:
        link: a link.

    Returns:
        Lines of text.
    """
    place = ", ".join(f"{v:g}" for v in link.tip)
    lines = [f"{link.method}; K read at the tip ({place}) m [N m/rad, N/rad, N/m]"]
    lines += _matrix(link.stiffness, "{:14.6g}")
    if not link.mesh:
        return "\n".join(lines)
    mesh = link.mesh
    asked = "reached" if mesh["reached"] else "NOT reached within the budget"
    lines += [
        f"largest relative error: {link.relative_error_estimate:.2g} (estimate); "
        f"the asked {mesh['accuracy']:g} was {asked}",
        f"mesh: {mesh['elements']} elements, {mesh['unknowns']} unknowns, "
        f"volume {mesh['volume']:.6g} m^3 (surface {mesh['surface_volume']:.6g}), "
        f"worst element {mesh['worst_quality']:.2f}, {mesh['meshes']} meshes, "
        f"{mesh['solver']}, {mesh['seconds']:.1f} s",
    ]
    lines += [f"repaired: {repair}" for repair in mesh["repairs"]]
    if link.mass > 0:
        center = ", ".join(f"{v:.5g}" for v in link.center_of_mass)
        lines.append(f"mass {link.mass:.5g} kg, centre ({center}) m")
    return "\n".join(lines)


def comparison_text(comparison: Comparison) -> str:
    """A beam beside finite elements, for a reader.

    Args:
        comparison: of one link by two methods.

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


def matrix_text(stiffness: NDArray) -> str:
    """A stiffness with its rows and columns named.

    Args:
        stiffness: (6, 6).

    Returns:
        Lines of text.
    """
    return "\n".join(_matrix(stiffness, "{:14.6g}"))


def _matrix(matrix: NDArray, form: str) -> list[str]:
    """Lines of a 6 by 6 matrix, rounding noise as zero."""
    head = "   " + "".join(f"{name:>14}" for name in SCREW)
    noise = 1e-12 * np.abs(matrix).max()
    rows = np.where(np.abs(matrix) < noise, 0.0, matrix)
    body = [
        f"{name} " + "".join(form.format(v) for v in row)
        for name, row in zip(WRENCH, rows, strict=True)
    ]
    return [head, *body]
