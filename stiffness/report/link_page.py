"""HTML report on the finite element stiffness of a link."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.page.charts import matrix
from forcefit.page.page import Page, Provenance, Tile, listed, page, paragraph, section
from forcefit.page.tables import Cell, Value, table
from forcefit.results.quantities import in_words, unit_of
from forcefit.stiffness.link import LinkStiffness
from forcefit.stiffness.report.results import link_results
from forcefit.stiffness.screws import SCREW, WRENCH

_ASSUMED = (
    "Small strains of a linear elastic, isotropic material.",
    "The base interface is clamped, and the wrench acts on the tip interface.",
    "The error is estimated from the sequence of meshes. The estimate is not a strict "
    "bound.",
)
_MESH = (
    "elements", "unknowns", "meshes", "volume", "surface_volume", "area",
    "surface_area", "worst_quality", "mean_quality", "smallest_angle", "largest_angle",
    "flat_elements", "solver",
)  # fmt: skip
_UNITS = {"surface_volume": "m^3", "surface_area": "m^2",
          "smallest_angle": "rad", "largest_angle": "rad"}  # fmt: skip


def link_page(link: LinkStiffness, provenance: Provenance) -> str:
    """Format the HTML report of a link.

    Args:
        link: result of :func:`forcefit.stiffness.fem.fea.solve_link`.
        provenance: command and files from which the link was computed.

    Returns:
        HTML text without references to other files.
    """
    place = ", ".join(f"{v:g}" for v in link.tip)
    return page(
        Page(
            title="Stiffness of a link",
            verdict=_verdict(link),
            good=_good(link),
            tiles=_tiles(link),
            about=f"{link.method}; K_E refers to the tip ({place}) m.",
            body=[
                _doubts(link),
                _matrices(link),
                section("Estimated error", _errors(link)),
                _mesh(link),
            ],
            assumed=_ASSUMED,
            provenance=provenance,
            results=link_results(link),
        )
    )


def _errors(link: LinkStiffness) -> str:
    """Plot the estimated error of each entry of K_E."""
    errors = 100 * link.relative_errors
    return matrix(
        errors, SCREW, "error [%]",
        "Of each entry of K_E, in per cent of sqrt(K_ii K_jj).",
        around=False, most=float(errors.max()) or 1.0,
    )  # fmt: skip


def _verdict(link: LinkStiffness) -> str:
    """Format a sentence on the estimated error and the required accuracy."""
    mesh, error = link.mesh, 100 * link.relative_error_estimate
    outcome = "reached" if mesh["reached"] else "not reached within the budget"
    text = (
        f"The largest error of K_E is estimated as {error:.2g} %; the required "
        f"{100 * mesh['accuracy']:g} % was {outcome}"
    )
    doubts = len(_doubtful(link))
    return text + (f", with {doubts} doubts about the surface." if doubts else ".")


def _good(link: LinkStiffness) -> bool | None:
    """Return whether the accuracy was reached, or None if the surface is doubtful."""
    if not link.mesh["reached"]:
        return False
    return None if _doubtful(link) else True


def _doubtful(link: LinkStiffness) -> list[str]:
    """List possible defects of the surface and the mesh as sentences."""
    mesh = link.mesh
    found = [f"Repaired: {one}." for one in mesh["repairs"]]
    if not mesh["closed"]:
        found.append("The surface is open.")
    if mesh.get("flat_elements"):
        found.append(
            f"{mesh['flat_elements']} elements are nearly flat (quality below 0.01): "
            "the surface has details much smaller than its walls, or rough facets."
        )
    return found


def _doubts(link: LinkStiffness) -> str:
    """Format the section on possible defects of the surface."""
    found = _doubtful(link)
    return section("Doubts about the surface", listed(found)) if found else ""


def _tiles(link: LinkStiffness) -> list[Tile]:
    """Return tiles with the main results."""
    K = np.diag(link.stiffness)
    turn, shift = int(np.argmin(K[:3])), 3 + int(np.argmin(K[3:]))
    tiles = [
        Tile("Estimated error", [f"{100 * link.relative_error_estimate:.2g} %"],
             [f"required: {100 * link.mesh['accuracy']:g} %."]),
        Tile(f"Least rotational stiffness, {SCREW[turn]}",
             [Value(K[turn], stiffness_unit(turn, turn))],
             ["The other motions are prevented."]),
        Tile(f"Least translational stiffness, {SCREW[shift]}",
             [Value(K[shift], stiffness_unit(shift, shift))],
             ["The other motions are prevented."]),
        Tile("Mesh", [f"{link.mesh['elements']} elements"],
             [f"{link.mesh['unknowns']} unknowns."]),
    ]  # fmt: skip
    if link.mass > 0:
        tiles.append(Tile("Mass", [Value(link.mass, "kg")]))
    return tiles


def _matrices(link: LinkStiffness) -> str:
    """Format the tables of K_E and its inverse."""
    return section(
        "Stiffness and compliance",
        paragraph("K_E [N m/rad, N/rad; N m/m, N/m], wrench = K_E screw:"),
        matrix_table(link.stiffness, WRENCH, "stiffness"),
        paragraph("Its inverse [rad/(N m), rad/N; m/(N m), m/N]:"),
        matrix_table(link.compliance, SCREW, "compliance", WRENCH),
    )


def matrix_table(
    values: NDArray, rows: tuple[str, ...], name: str,
    columns: tuple[str, ...] = SCREW,
) -> str:  # fmt: skip
    """Format a (6, 6) matrix as an HTML table.

    Args:
        values: (6, 6) stiffness or compliance. Entries that are negligible relative to
            sqrt(K_ii K_jj) are shown as zero, and infinite entries as ``rigid``.
        rows: names of the rows.
        name: title of the table.
        columns: names of the columns.

    Returns:
        HTML text of the table.
    """
    size = np.sqrt(np.abs(np.nan_to_num(np.diag(values), posinf=0.0)))
    shown = np.where(np.abs(values) < 1e-10 * np.outer(size, size), 0.0, values)
    cells: list[list[Cell]] = [
        [row, *(v if math.isfinite(v) else "rigid" for v in line)]
        for row, line in zip(rows, shown.tolist(), strict=True)
    ]
    return table(["component", *columns], cells, name)


def stiffness_unit(i: int, j: int) -> str:
    """Return the SI unit of an entry of a stiffness matrix."""
    return ("N m/rad", "N", "N/m")[int(i > 2) + int(j > 2)]


def _mesh(link: LinkStiffness) -> str:
    """Format the section on the mesh and the mass properties."""
    rows: list[list[Cell]] = [
        [in_words(key), _cell(key, link.mesh[key])] for key in _MESH if key in link.mesh
    ]
    if link.mass > 0:
        rows.append([in_words("mass"), Value(link.mass, "kg", 5)])
        rows += [
            [f"{in_words('center_of_mass')} {axis}", Value(v, "m", 5)]
            for axis, v in zip("xyz", link.center_of_mass, strict=True)
        ]
    return section("Mesh", table(["quantity", "value"], rows, "mesh"))


def _cell(key: str, value: Any) -> Cell:
    """Format a value from the mesh report with its unit."""
    if isinstance(value, str):
        return value
    unit = _UNITS.get(key) or unit_of(key)
    return Value(float(value) if math.isfinite(value) else math.nan, unit, 6)
