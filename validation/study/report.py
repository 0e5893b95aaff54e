"""Report of a study: one self-contained HTML page, and the results as JSON."""

import html
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assembly.linear.zone import ASSEMBLABLE
from forcefit.inputs.table import BadInput
from forcefit.inputs.writing import write_json, write_text
from stiffness.screws import SCREW
from validation.crosscheck.verdict import verdict_text
from validation.html import (
    html_figure,
    html_image,
    html_page,
    html_table,
    png_bytes,
)
from validation.study.headline import verdict, worst_clearance
from validation.study.platform_section import platform_section
from validation.study.study import StudyResults, points_solved

_CLEARANCE_OF = {
    "frozen": "anywhere while no deformation changes",
    "free": "anywhere, and compliant joints turn about their own axis",
    "budget": "anywhere, and springs too, with 5 % more than the least energy",
}
# of the maps: key, name, factor
_MAPPED = (
    ("margin", "zone margin, eq. (21)", 1.0),
    ("margin_free", "zone margin, compliant joints free", 1.0),
    ("energy", "energy, eq. (22) [J]", 1.0),
    ("rotation_error", "largest turn, eq. (27) [mrad], clearances anywhere", 1e3),
    ("translation_error", "largest shift, eq. (27) [mm], clearances anywhere", 1e3),
)


def write_study(results: StudyResults) -> Path:
    """Write ``report.html``, ``results.json`` and ``results.nc`` of a study.

    Args:
        results: of :func:`validation.study.study.run_study`.

    Returns:
        The folder.

    Raises:
        BadInput: the folder cannot be written.
    """
    from assembly.sweeps.dataset import save_dataset

    folder, page = results.study.folder, report_page(results)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BadInput(f"{folder}: cannot be written: {error.strerror}") from None
    write_text(page, folder / "report.html")
    write_json(results_table(results), str(folder / "results.json"))
    if results.maps is not None:
        save_dataset(results.maps, folder / "results.nc")
    return folder


def results_table(results: StudyResults) -> dict[str, Any]:
    """The results of a study, as plain values."""
    table: dict[str, Any] = {
        "program": f"forcefit {version('forcefit')}",
        "title": results.study.title,
        "errors": results.study.errors,
        "links": results.study.source,
        "passed": results.passed,
        "verdicts": results.verdicts,
        "unchecked": results.unchecked,
        "worst_play": worst_clearance(results),
        "solution": results.solution,
        "error": results.error,
        "reference": results.reference,
        "stiffness": results.stiffness,
        "platform_stiffness": results.platform_stiffness,
    }
    if results.crosscheck is not None:
        table["crosscheck"] = results.crosscheck.table()
    elif results.crosscheck_failure:
        table["crosscheck"] = {"passed": False, "reason": results.crosscheck_failure}
    if results.maps is not None:
        table["maps"] = map_summary(results.maps)
    return table


def map_summary(maps: Any) -> dict[str, Any]:
    """Least, median and largest value of each map, and the counts of the statuses."""
    names, counts = np.unique(maps["status"].values.astype(str), return_counts=True)
    summary: dict[str, Any] = {"status": dict(zip(names, counts.tolist(), strict=True))}
    arrays = {key: maps[key].values for key in ("margin", "margin_free", "energy")}
    for key in ("rotation_error", "translation_error"):
        arrays[key] = maps[key].sel(bound="upper").values
    for key, values in arrays.items():
        values = values[~np.isnan(values)] if "error" in key else (
            values[np.isfinite(values)]
        )  # fmt: skip
        if len(values):
            summary[key] = [values.min(), float(np.median(values)), values.max()]
    solved = points_solved(maps)
    share = int((maps["margin_free"] <= ASSEMBLABLE).sum()) / solved if solved else None
    return summary | {"share_assemblable_free": share}


def report_page(results: StudyResults) -> str:
    """The page as HTML with its pictures inside."""
    study, robot = results.study, results.robot
    parts = [
        f"<h1>{html.escape(study.title)}</h1>",
        f"<p class=note>{html.escape(robot.name)}: {html.escape(robot.description)}. "
        f"{len(robot.frames)} frames, {len(robot.closures)} closures; "
        f"{html.escape(study.errors)}; link stiffness: {study.source}. "
        f"forcefit {version('forcefit')}. SI units, screws [R T], wrenches [M F].</p>",
        _verdict(results),
        _unchecked(results),
        _solution(results),
        platform_section(results.platform_stiffness),
    ]
    if results.reference is not None:
        parts.append(_reference(results))
    if results.stiffness:
        parts.append(_stiffness(results.stiffness))
    if results.maps is not None:
        parts.append(_maps(results))
    if results.assembly is not None and "picture" in study.checks:
        parts.append(_picture(results))
    if results.crosscheck is not None or results.crosscheck_failure:
        parts.append(_crosscheck(results))
    parts.append(_left_out())
    return html_page(study.title, "\n".join(parts))


def _verdict(results: StudyResults) -> str:
    """The conclusion at the top."""
    kind = "good" if results.passed else "bad"
    return f"<p class='verdict {kind}'>{html.escape(verdict(results))}</p>"


def _unchecked(results: StudyResults) -> str:
    """What could not be checked, and why."""
    if not results.unchecked:
        return ""
    rows = [[name, why] for name, why in results.unchecked.items()]
    return "<h2>What could not be checked</h2>" + html_table(["check", "why"], rows)


def _solution(results: StudyResults) -> str:
    """The assembly at the study's pose, with its certificate."""
    solution = results.solution
    pose = ", ".join(
        f"{k} = {round(v, 9) + 0.0:g}" for k, v in solution["pose"].items()
    )
    parts = [f"<h2>Assembly at one pose</h2><p>Nominal pose: {pose} [m, rad].</p>"]
    rows = [[k, str(v)] for k, v in solution["mobility"].items()]
    zone = solution.get("zone", {})
    for key in ("margin", "margin_free"):
        rows.append([f"zone {key}, eq. (21)", _number(zone.get(key))])
    if solution["status"] == "ok":
        rows.append(["energy, eq. (22) [J]", f"{solution['energy']:.9g}"])
        for name, value in zip(SCREW, solution["platform_screw"], strict=True):
            quantity = f"platform error {name} [rad, m], clearances at least energy"
            rows.append([quantity, f"{value:.6e}"])
        for key, value in solution["certificate"].items():
            rows.append([f"certificate: {key}", f"{value:.2e}"])
        rows += _linearisation_rows(solution["linearisation_error"])
    parts.append(html_table(["quantity", "value"], rows))
    if solution["status"] == "ok":
        parts.append(_wrenches(results))
    if results.error:
        parts.append(_pose_error(results))
    return "".join(parts)


def _linearisation_rows(error: dict[str, Any]) -> list[list[str]]:
    """What linear closures cost against finite motions."""
    if error["status"] != "ok":
        return [["linearisation error", error["status"]]]
    return [
        ["linearisation error, rotation [rad]", _size(error["rotation"])],
        ["linearisation error, translation [m]", _size(error["translation"])],
        ["linearisation error, energy", f"{100 * error['relative_energy']:+.3g} %"],
    ]


def _size(vector: NDArray) -> str:
    """Length of a vector."""
    return f"{np.linalg.norm(vector):.2e}"


def _pose_error(results: StudyResults) -> str:
    """Bounds of (27) in each reading."""
    rows = []
    for reading, bounds in results.error.items():
        row = [reading]
        for key in ("rotation", "translation"):
            row += [f"{1e3 * bounds[key][side]:.6g}" for side in ("lower", "upper")]
        rows.append([*row, _CLEARANCE_OF[reading]])
    head = [
        "reading",
        "rotation >=",
        "<= [mrad]",
        "translation >=",
        "<= [mm]",
        "clearances",
    ]
    return (
        "<p>Largest error of the platform's pose, problem (27), between certified "
        "bounds.</p>" + html_table(head, rows)
    )


def _wrenches(results: StudyResults) -> str:
    """Wrench through each elastic link."""
    frames = results.solution["frames"]
    rows = [
        [f.name, *(f"{v:.4g}" for v in frames[f.name]["wrench"])]
        for f in results.robot.frames
        if f.link is not None
    ]
    head = ["link", "MX", "MY", "MZ [N m]", "FX", "FY", "FZ [N]"]
    return (
        "<p>Wrench each elastic link transmits, at its tip in its own axes:</p>"
        + html_table(head, rows)
    )


def _reference(results: StudyResults) -> str:
    """The printed problems solved again."""
    reference, solution = results.reference, results.solution
    assert reference is not None
    if "reason" in reference:
        return (
            "<h2>The same problems as printed, in cvxpy</h2>"
            f"<p>Not compared: {html.escape(reference['reason'])}</p>"
        )
    ours = {"energy": solution["energy"], "margin": solution["zone"]["margin"]}
    ours["margin_free"] = solution["zone"]["margin_free"]
    rows = [
        [k, _number(ours[k], 10), _number(reference[k], 10),
         "nothing to compare" if np.isnan(d) else f"{d:.1e}"]
        for k, d in reference["relative_difference"].items()
    ]  # fmt: skip
    return (
        "<h2>The same problems as printed, in cvxpy</h2>"
        "<p>Every screw of every frame a variable, every constraint an equation of the "
        f"paper; differences must stay below {reference['tolerance']:g}.</p>"
        + html_table(["", "reduced problem", "cvxpy", "relative difference"], rows)
    )


def _stiffness(stiffness: dict[str, dict[str, Any]]) -> str:
    """Beam against finite elements."""
    from validation.crosscheck.plot import stiffness_figure

    name, compared = next(iter(stiffness.items()))
    shared = f" ({len(stiffness)} links share this shape)" if len(stiffness) > 1 else ""
    fea, euler, timoshenko = (compared[k] for k in ("fea", "euler", "timoshenko"))
    rows = [
        [f"{SCREW[i]}, {SCREW[j]}", f"{euler[i, j]:.6g}", f"{timoshenko[i, j]:.6g}",
         f"{fea[i, j]:.6g}", f"{100 * (fea[i, j] / timoshenko[i, j] - 1):+.2f} %"]
        for i, j in zip(*np.nonzero(np.triu(_significant(euler))), strict=True)
    ]  # fmt: skip
    count = compared["mesh"].get("elements", "?")
    return (
        f"<h2>Link stiffness K_E: beam and finite elements</h2><p>Link "
        f"{html.escape(name)}{shared}, {count} cubic tetrahedra, estimated error "
        f"{100 * compared['relative_error_estimate']:.2g} %. A solid held at a "
        "rigid face is stiffer than a beam by about r/L of itself, and a beam without "
        "shear (Euler-Bernoulli) is stiffer than one with it: a few per cent between "
        "the columns are physics, not an error.</p>"
        + html_table(
            ["entry [N m/rad .. N/m]", "Euler-Bernoulli", "Timoshenko",
             "finite elements", "to Timoshenko"],
            rows,
        )
        + html_figure(
            stiffness_figure(timoshenko, fea),
            "Finite elements minus Timoshenko beam, entry by entry.",
        )
    )  # fmt: skip


def _significant(K: NDArray) -> NDArray:
    """(6, 6) bool: entries above a thousandth of sqrt(K_ii K_jj)."""
    size = np.sqrt(np.diag(K))
    return np.abs(K) > 1e-3 * np.outer(size, size)


def _maps(results: StudyResults) -> str:
    """Maps over the grid."""
    from assembly.sweeps.maps import map_figure

    summary = map_summary(results.maps)
    rows = [
        [name, *(f"{factor * v:.4g}" for v in summary[key])]
        for key, name, factor in _MAPPED
        if key in summary
    ]
    counts = html.escape(", ".join(f"{k}: {v}" for k, v in summary["status"].items()))
    share = summary["share_assemblable_free"]
    if share is None:
        return f"<h2>Over the workspace</h2><p>{counts}. No point has an answer.</p>"
    axes = [d for d in results.maps["energy"].dims if results.maps.sizes[d] > 1]
    picture = ""
    if len(axes) == 2:
        picture = html_figure(
            map_figure(results.maps),
            "Maps over the grid; the platform's errors are the bounds of (27), "
            "clearances anywhere.",
        )
    return (
        f"<h2>Over the workspace</h2><p>{counts}. Assembles rigidly with "
        f"compliant joints free at {100 * share:.1f} % of the points with an answer."
        "</p>" + html_table(["", "least", "median", "largest"], rows) + picture
    )


def _picture(results: StudyResults) -> str:
    """The robot, deformed."""
    from assembly.report.plot import robot_plotter

    assert results.assembly is not None
    plotter = robot_plotter(results.assembly)
    pixels = plotter.screenshot(return_img=True)
    plotter.close()
    caption = (
        "Nominal (grey) and forced robot, its clearances at least energy; the "
        "exaggeration is on the picture."
    )
    return "<h2>The forced robot</h2>" + html_image(png_bytes(pixels), caption)


def _crosscheck(results: StudyResults) -> str:
    """VJM against the multibody simulation."""
    from validation.crosscheck.plot import closing_figure, slope_figure

    check = results.crosscheck
    head = "<h2>Against a multibody simulation</h2><p>"
    if check is None:
        return f"{head}Not compared: {html.escape(results.crosscheck_failure)}</p>"
    closing = ""
    if results.closing is not None:
        figure = closing_figure(check.posture, results.closing)
        closing = html_figure(figure, "The simulation closes the open robot by force.")
    return (
        head + "The same forced assembly, without "
        "clearances, as a geometrically nonlinear flexible multibody system (Exudyn). "
        "A linearised model must differ from it by the square of the errors' size: "
        f"slope 2. {_slope_text(check.slope)} {html.escape(verdict_text(check))}.</p>"
        + html_table(check.metric.header(), check.metric.rows())
        + html_figure(
            slope_figure(check),
            "Difference of the platform's pose, without clearances.",
        )
        + closing
    )


def _slope_text(slope: float) -> str:
    """The slope measured, if there is one."""
    if np.isnan(slope):
        return "Nothing separates the two here, so there is no slope."
    return f"Measured: {slope:.3f}."


def _left_out() -> str:
    """Limits of the model."""
    return (
        "<h2>What this leaves out</h2><p>Small screws: the closures are linear in "
        "them, and the cross-check above shows what that costs at these errors. Links "
        "act at their ends; no contact stiffness, friction, temperature or dynamics. "
        "The cross-check leaves the clearances out on both sides.</p>"
    )


def _number(value: float | None, digits: int = 6) -> str:
    """A number, or that there is none."""
    return "none" if value is None else f"{value:.{digits}g}"
