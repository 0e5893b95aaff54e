"""Create the HTML sections of a study's report page."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.linear.assembled import without_rounding
from forcefit.assembly.linear.reference.pose_error import reachable_screws
from forcefit.assembly.report.error_body import ErrorBody, error_body
from forcefit.assembly.report.scene import robot_scene
from forcefit.assembly.solvers.conic import SolverFailed
from forcefit.page.charts import matrix
from forcefit.page.page import paragraph, section
from forcefit.page.tables import Cell, Column, Value, rotation_and_translation, table
from forcefit.results.quantities import in_words, unit_of
from forcefit.stiffness.link import scaled
from forcefit.stiffness.report.link_page import stiffness_unit
from forcefit.stiffness.screws import SCREW, SCREW_UNITS, WRENCH, WRENCH_UNITS
from forcefit.validation.crosscheck.report import compared
from forcefit.validation.crosscheck.verdict import verdict_text
from forcefit.validation.study.headline import WORST, worst_clearance
from forcefit.validation.study.study import StudyResults

_CLEARANCE_OF = {
    "frozen": "any position without a change of deformation",
    "free": "any position; compliant joints also rotate about their axis",
    "budget": "any position and deformation within 5 % of the minimum energy",
}
_PARTS = ("rotation", "translation")
_UNITS = {"rx": "rad", "ry": "rad", "rz": "rad", "tx": "m", "ty": "m", "tz": "m"}


def unchecked_section(results: StudyResults) -> str:
    """Return the section with the checks that were not possible."""
    rows = [[in_words(name), why] for name, why in results.unchecked.items()]
    if not rows:
        return ""
    return section("Checks that were not possible", table(["check", "reason"], rows))


def robot_section(results: StudyResults) -> str:
    """Return the section that shows the forced robot."""
    if results.assembly is None or "picture" not in results.study.checks:
        return ""
    caption = (
        "Nominal robot (grey) and minimum-energy forced robot. Red: elastic links; "
        "blue: rigid bodies; orange: driven joints; yellow: possible platform errors "
        f"within the clearances (assumption {WORST}), with the same exaggeration."
    )
    if results.closing is not None:
        caption += " The closing is simulated without clearances."
    body = _error_body(results)
    return section(
        "The forced robot",
        robot_scene(results.assembly, results.closing, body, caption),
    )


def _error_body(results: StudyResults) -> ErrorBody | None:
    """Return the set of possible platform translations, or None if unbounded."""
    assert results.assembly is not None
    reach = reachable_screws(results.assembly, WORST)
    if reach.unbounded(3):
        return None
    try:
        return error_body(reach, "translation")
    except SolverFailed:
        return None


def governing_section(results: StudyResults) -> str:
    """Return the section on the certified worst case with one perfect part."""
    worst = worst_clearance(results)["pose"]
    if worst is None or not results.governing:
        return ""
    rows = [
        [one["part"], one["what"], *(_change(one, worst, k) for k in _PARTS)]
        for one in results.governing
    ]
    head = ["part", "made perfect"]
    for part in _PARTS:
        head += [f"largest {in_words(part)}", "change"]
    flat = [[*row[:2], *(cell for pair in row[2:] for cell in pair)] for row in rows]
    return section(
        "Parts that govern the worst case",
        paragraph(
            "The certified bound at this pose is ",
            *rotation_and_translation(worst["rotation"], worst["translation"]),
            ". The table lists the bound without one of the imperfections. The bound "
            "increases if the removed error compensated another error.",
        ),
        table(head, flat, "governing parts"),
    )  # fmt: skip


def _change(one: dict[str, Any], worst: dict[str, float], part: str) -> list[Any]:
    """Return the bound without an imperfection, and its change in per cent."""
    value = one[part]
    if value is None or not np.isfinite([value, worst[part]]).all():
        return ["none" if value is None else Value(value, unit_of(part)), "-"]
    if worst[part] == 0.0:
        return [Value(value, unit_of(part)), "-"]
    return [Value(value, unit_of(part)), f"{100 * (value / worst[part] - 1):+.1f} %"]


def solution_section(results: StudyResults) -> str:
    """Return the section on the assembly at the study's pose and its certificate."""
    solution = results.solution
    pose = [
        text
        for k, unit in _UNITS.items()
        for text in (
            f"{', ' if k != 'rx' else ''}{k} = ",
            Value(round(solution["pose"][k], 9), unit),
        )
    ]
    rows: list[list[Any]] = [[in_words(k), str(v)] if isinstance(v, int) else
                             [in_words(k), Value(v)]
                             for k, v in solution["mobility"].items()
                             if type(v) in (int, float)]  # fmt: skip
    zone = solution.get("zone", {})
    for key in ("margin", "margin_free"):
        rows.append([f"{in_words(key)}, eq. (21)", _number(zone.get(key), "")])
    if solution["status"] == "ok":
        rows.append(["energy, eq. (22)", Value(solution["energy"], "J", 9)])
        for k, value in enumerate(solution["platform_screw"]):
            quantity = f"platform error {SCREW[k]}, minimum energy"
            rows.append([quantity, Value(value, SCREW_UNITS[k], 6)])
        for key, value in solution["certificate"].items():
            rows.append([f"certificate: {in_words(key)}", _number(value, unit_of(key))])
        rows += _linearisation_rows(solution["linearisation_error"])
    parts = [
        paragraph("Nominal pose: ", *pose, "."), table(["quantity", "value"], rows)
    ]  # fmt: skip
    if solution["status"] == "ok":
        parts.append(_wrenches(results))
    if results.error:
        parts.append(_pose_error(results))
    return section("Assembly at one pose", *parts)


def _linearisation_rows(error: dict[str, Any]) -> list[list[Any]]:
    """Return table rows on the linearisation error of the closures."""
    if error["status"] != "ok":
        return [["linearisation error", error["status"]]]
    turn, shift = (float(np.linalg.norm(error[k])) for k in ("rotation", "translation"))
    return [
        ["linearisation error, rotation", Value(turn, "rad", 3)],
        ["linearisation error, translation", Value(shift, "m", 3)],
        ["linearisation error, energy", f"{100 * error['relative_energy']:+.3g} %"],
    ]


def _pose_error(results: StudyResults) -> str:
    """Return a table of the bounds of problem (27) under each assumption."""
    rows = [
        [
            assumption,
            *(
                bounds[key][side] if bounds[key] else float("nan")
                for key in ("rotation", "translation")
                for side in ("lower", "upper")
            ),
            _CLEARANCE_OF[assumption],
        ]
        for assumption, bounds in results.error.items()
    ]
    head: list[str | Column] = [
        "assumption",
        Column("rotation at least", "rad", 6), Column("at most", "rad", 6),
        Column("translation at least", "m", 6), Column("at most", "m", 6), "clearances",
    ]  # fmt: skip
    return paragraph(
        "Certified bounds on the platform's largest pose error, problem (27)."
    ) + table(head, rows, "pose errors")


def _wrenches(results: StudyResults) -> str:
    """Return a table of the wrench through each elastic link."""
    frames = results.solution["frames"]
    elastic = [f.name for f in results.robot.frames if f.link is not None]
    wrenches = without_rounding(
        np.reshape([frames[name]["wrench"] for name in elastic], (-1, 6))
    )
    rows = [
        [name, *wrench] for name, wrench in zip(elastic, wrenches.tolist(), strict=True)
    ]
    head: list[str | Column] = [
        "link",
        *(Column(n, u) for n, u in zip(WRENCH, WRENCH_UNITS, strict=True)),
    ]
    return paragraph(
        "Wrench that each elastic link transmits, at the tip in link axes:"
    ) + table(head, rows, "wrenches")


def reference_section(results: StudyResults) -> str:
    """Return the section on the paper's problems solved with cvxpy."""
    reference, solution = results.reference, results.solution
    title = "The same problems as printed, in cvxpy"
    if reference is None:
        return ""
    if "reason" in reference:
        return section(title, paragraph(f"Not compared: {reference['reason']}"))
    ours = {"energy": solution["energy"], "margin": solution["zone"]["margin"]}
    ours["margin_free"] = solution["zone"]["margin_free"]
    rows = [
        [in_words(k), _number(ours[k], unit_of(k), 10),
         _number(reference[k], unit_of(k), 10),
         "nothing to compare" if np.isnan(d) else Value(d, "", 2)]
        for k, d in reference["relative_difference"].items()
    ]  # fmt: skip
    return section(
        title,
        paragraph(
            "The variables are the screws of all frames, and the constraints are the "
            "equations of the paper. Differences must be below "
            f"{reference['tolerance']:g}."
        ),
        table(["quantity", "reduced problem", "cvxpy", "relative difference"], rows),
    )


def stiffness_section(results: StudyResults) -> str:
    """Return the section that compares beam theory with finite elements."""
    if not results.stiffness:
        return ""
    stiffness = results.stiffness
    name, compared = next(iter(stiffness.items()))
    shared = f" ({len(stiffness)} links share this shape)" if len(stiffness) > 1 else ""
    fea, euler, timoshenko = (compared[k] for k in ("fea", "euler", "timoshenko"))
    rows: list[list[Cell]] = [
        [f"{SCREW[i]}, {SCREW[j]}",
         *(Value(K[i, j], stiffness_unit(i, j), 6) for K in (euler, timoshenko, fea)),
         f"{100 * (fea[i, j] / timoshenko[i, j] - 1):+.2f} %"]
        for i, j in zip(*np.nonzero(np.triu(_significant(euler))), strict=True)
    ]  # fmt: skip
    count = compared["mesh"].get("elements", "?")
    return section(
        "Link stiffness K_E: beam and finite elements",
        paragraph(
            f"Link {name}{shared}, {count} cubic tetrahedra, estimated error "
            f"{100 * compared['relative_error_estimate']:.2g} %. A solid with rigid "
            "ends is stiffer than a beam by a fraction of about r/L, and an "
            "Euler-Bernoulli beam is stiffer than a beam with shear. Differences of a "
            "few per cent between the columns are therefore not numerical errors."
        ),
        table(
            ["entry", "Euler-Bernoulli", "Timoshenko", "finite elements",
             "to Timoshenko"],
            rows, "link stiffness",
        ),
        matrix(
            100 * scaled(fea - timoshenko, timoshenko), SCREW,
            "difference [% of sqrt(K_ii K_jj)]",
            "Finite elements minus Timoshenko beam, entrywise.", around=True,
        ),
    )  # fmt: skip


def _significant(K: NDArray) -> NDArray:
    """Return a mask (6, 6) of the entries above 0.001 sqrt(K_ii K_jj)."""
    size = np.sqrt(np.diag(K))
    return np.abs(K) > 1e-3 * np.outer(size, size)


def crosscheck_section(results: StudyResults) -> str:
    """Return the section on the multibody simulation."""
    check, title = results.crosscheck, "Comparison with a multibody simulation"
    if check is None:
        if not results.crosscheck_failure:
            return ""
        return section(title, paragraph(f"Not compared: {results.crosscheck_failure}"))
    return section(
        title,
        paragraph(
            "The same forced assembly, without clearances, as a geometrically "
            f"nonlinear flexible multibody system (Exudyn): {verdict_text(check)}."
        ),
        *compared(check),
    )


def _number(value: float | None, unit: str, digits: int = 6) -> str | Value:
    """Format a number with its unit, or return "none" for None."""
    return "none" if value is None else Value(value, unit, digits)
