"""Create the report page that compares platform stiffness with a simulation."""

import numpy as np

from forcefit.assembly.model.statuses import FAILED, PASSED
from forcefit.page.page import Page, Provenance, Tile, page, paragraph, section
from forcefit.page.tables import Cell, Column, Value, table
from forcefit.stiffness.screws import SCREW
from forcefit.validation.crosscheck.report import ASSUMED, GOOD, screw_table
from forcefit.validation.crosscheck.stiffness_check import StiffnessCheck

Cells = list[list[Cell]]


def stiffness_check_page(check: StiffnessCheck, provenance: Provenance) -> str:
    """Return the report page of the platform stiffness by several methods.

    Args:
        check: result of
            :func:`forcefit.validation.crosscheck.stiffness_check.check_stiffness`.
        provenance: command and input files.

    Returns:
        A self-contained HTML page.
    """
    robot = check.exact.posture.robot.name
    words = {PASSED: "agrees with", FAILED: "differs from"}.get(
        check.outcome, "cannot be compared with"
    )
    return page(
        Page(
            title=f"{robot}: stiffness of the platform by a multibody simulation",
            verdict=f"The exact stiffness {words} the simulation: {check.reason}.",
            good=GOOD[check.outcome],
            tiles=_stiffness_tiles(check),
            about=f"Links in the simulation: {check.links}.",
            body=[_compliances(check), _methods(check), _displacements(check)],
            assumed=ASSUMED,
            provenance=provenance,
            results=check.table(),
        )
    )


def _stiffness_tiles(check: StiffnessCheck) -> list[Tile]:
    """Return tiles with the difference of each method from the exact stiffness."""
    return [
        Tile(words, [f"{100 * check.differences[name]:.2g} %"],
             [f"uncertainty {100 * check.uncertainties[name]:.2g} %; accepted "
              f"{100 * check.tolerance:g} %."])
        for name, words in (("exact", "Difference from load steps"),
                            ("linearised", "Difference from the linearised simulation"))
        if check.uncertainties[name] <= check.tolerance
    ]  # fmt: skip


def _compliances(check: StiffnessCheck) -> str:
    """Return a table of the diagonal of each compliance."""
    names = ["exact", "linear", "load steps", "linearised simulation"]
    matrices = [check.exact.compliance, check.linear.compliance,
                check.simulated.stepped, check.simulated.linearised]  # fmt: skip
    rows: Cells = [
        [name, *(Value(float(C[k, k]), ("rad/(N m)", "m/N")[k // 3], 5)
                 for C in matrices)]
        for k, name in enumerate(SCREW)
    ]  # fmt: skip
    text = paragraph("Motion along each axis for a unit wrench along the same axis.")
    return section("Diagonal of the compliance", text,
                   table(["component", *names], rows, "compliance"))  # fmt: skip


def _methods(check: StiffnessCheck) -> str:
    """Return a table of the differences and uncertainties of the methods."""
    words = {"exact": "exact minus load steps", "linearised": "exact minus linearised "
             "simulation", "linear": "linear minus linearised simulation"}  # fmt: skip
    rows: Cells = [
        [text, check.differences[name], check.uncertainties.get(name, np.nan)]
        for name, text in words.items()
    ]
    head: list[str | Column] = [
        "methods", Column("largest difference of sqrt(C_ii C_jj)", digits=2),
        Column("uncertainty", digits=2),
    ]  # fmt: skip
    return section("Differences of the methods", table(head, rows, "methods"))


def _displacements(check: StiffnessCheck) -> str:
    """Return a table of the platform's displacement at both equilibria."""
    return section(
        "The platform at the equilibrium",
        screw_table(check.moved, check.simulated_moved),
    )
