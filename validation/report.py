"""One self-contained page of a study, and its results for machines."""

import html
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stiffness.reading import BadInput
from stiffness.screws import SCREW
from stiffness.writing import write_json, write_text
from validation.html import (
    html_figure,
    html_image,
    html_page,
    html_table,
    png_bytes,
)
from validation.study import StudyResults


def write_study(results: StudyResults) -> Path:
    """Write ``report.html``, ``results.json`` and ``results.nc`` of a study.

    Args:
        results: of :func:`validation.study.run_study`.

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
    """Everything a study found, as plain values."""
    table: dict[str, Any] = {
        "program": f"forcefit {version('forcefit')}",
        "title": results.study.title,
        "errors": results.study.errors,
        "links": results.study.source,
        "passed": results.passed,
        "solution": results.solution,
        "error": results.error,
        "reference": results.reference,
        "stiffness": results.stiffness,
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
    for key in ("margin", "margin_free", "energy"):
        values = maps[key].values[np.isfinite(maps[key].values)]
        if len(values):
            summary[key] = [values.min(), float(np.median(values)), values.max()]
    share = (maps["margin_free"] <= 1 + 1e-6).sum() / (maps["status"] == "ok").sum()
    return summary | {"share_assemblable_free": float(share)}


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
        _solution(results),
    ]
    if results.reference is not None:
        parts.append(_reference(results))
    if results.stiffness:
        parts.append(_stiffness(results.stiffness))
    if results.maps is not None:
        parts.append(_maps(results))
    if results.answer is not None and "picture" in study.checks:
        parts.append(_picture(results))
    if results.crosscheck is not None or results.crosscheck_failure:
        parts.append(_crosscheck(results))
    parts.append(_left_out())
    return html_page(study.title, "\n".join(parts))


def _verdict(results: StudyResults) -> str:
    """The honest sentence at the top."""
    kind = "good" if results.passed else "bad"
    return f"<p class='verdict {kind}'>{html.escape(verdict(results))}</p>"


def verdict(results: StudyResults) -> str:
    """What the study found, in three sentences.

    Args:
        results: of :func:`validation.study.run_study`.

    Returns:
        Plain text.
    """
    solution = results.solution
    if solution["status"] != "ok":
        return f"No answer at this pose: {solution['status']}, {solution['reason']}."
    zone = solution["zone"]
    if zone["assemblable"] or zone["assemblable_free"]:
        goes = "It goes together by its clearances alone"
        goes += "" if zone["assemblable"] else " if its compliant joints turn freely"
    else:
        goes = f"It goes together only by force: {solution['energy']:.4g} J"
        if zone["margin_free"] is not None:
            goes += f", its play being {zone['margin_free']:.3g} times too small"
    screw = solution["platform_screw"]
    ends = (
        f"The platform ends up {1e3 * np.linalg.norm(screw[3:]):.3g} mm and "
        f"{1e3 * np.linalg.norm(screw[:3]):.3g} mrad from its nominal pose."
    )
    checks = [c for c in (results.reference, results.crosscheck) if c is not None]
    how = "passed" if results.passed else "did not all pass"
    said = f"Independent checks of these numbers: {len(checks)}; they {how}."
    return f"{goes}. {ends} {said if checks else ''}".strip()


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
            rows.append([f"platform error {name} [rad, m]", f"{value:.6e}"])
        for key, value in solution["certificate"].items():
            rows.append([f"certificate: {key}", f"{value:.2e}"])
        rows += _linearisation_rows(solution["linearisation_error"])
    parts.append(html_table(["quantity", "value"], rows))
    if solution["status"] == "ok":
        parts.append(_wrenches(results))
    if results.error:
        parts.append(_pose_error(results))
    return "".join(parts)


def _linearisation_rows(found: dict[str, Any]) -> list[list[str]]:
    """What linear closures cost against finite motions."""
    if found["status"] != "ok":
        return [["linearisation error", found["status"]]]
    return [
        ["linearisation error, rotation [rad]", _size(found["rotation"])],
        ["linearisation error, translation [m]", _size(found["translation"])],
        ["linearisation error, energy", f"{100 * found['relative_energy']:+.3g} %"],
    ]


def _size(vector: NDArray) -> str:
    """Length of a vector."""
    return f"{np.linalg.norm(vector):.2e}"


def _pose_error(results: StudyResults) -> str:
    """Bounds of (27) in each reading."""
    rows = []
    for reading, found in results.error.items():
        row = [reading]
        for key in ("rotation", "translation"):
            row += [f"{1e3 * found[key][side]:.6g}" for side in ("lower", "upper")]
        rows.append(row)
    head = ["reading", "rotation >=", "<= [mrad]", "translation >=", "<= [mm]"]
    return (
        "<p>Largest error of the platform's pose, problem (27), between certified "
        "bounds. Frozen: deformations stay as they are. Free: compliant joints also "
        "turn about their own axis. Budget: all that closes with 5 % more energy.</p>"
        + html_table(head, rows)
    )


def _wrenches(results: StudyResults) -> str:
    """Wrench through each elastic link."""
    frames = results.solution["frames"]
    rows = [
        [html.escape(f.name), *(f"{v:.4g}" for v in frames[f.name]["wrench"])]
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
    ours = {"energy": solution["energy"], "margin": solution["zone"]["margin"]}
    ours["margin_free"] = solution["zone"]["margin_free"]
    rows = [
        [k, _number(ours[k], 10), _number(reference[k], 10), f"{d:.1e}"]
        for k, d in reference["relative_difference"].items()
    ]
    return (
        "<h2>The same problems as printed, in cvxpy</h2>"
        "<p>Every screw of every frame a variable, every constraint an equation of the "
        f"paper; differences must stay below {reference['tolerance']:g}.</p>"
        + html_table(["", "reduced problem", "cvxpy", "relative difference"], rows)
    )


def _stiffness(stiffness: dict[str, dict[str, Any]]) -> str:
    """Beam against finite elements."""
    from validation.plot import stiffness_figure

    name, found = next(iter(stiffness.items()))
    alike = f" ({len(stiffness)} links share this shape)" if len(stiffness) > 1 else ""
    fea, euler, timoshenko = (found[k] for k in ("fea", "euler", "timoshenko"))
    rows = [
        [f"{SCREW[i]}, {SCREW[j]}", f"{euler[i, j]:.6g}", f"{timoshenko[i, j]:.6g}",
         f"{fea[i, j]:.6g}", f"{100 * (fea[i, j] / timoshenko[i, j] - 1):+.2f} %"]
        for i, j in zip(*np.nonzero(np.triu(_significant(euler))), strict=True)
    ]  # fmt: skip
    count = found["mesh"].get("elements", "?")
    return (
        f"<h2>Link stiffness K_E: beam and finite elements</h2><p>Link "
        f"{html.escape(name)}{alike}, {count} cubic tetrahedra, estimated error "
        f"{100 * found['relative_error_estimate']:.2g} %. A solid held at a "
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
        [key, *(f"{v:.4g}" for v in summary[key])]
        for key in ("margin", "margin_free", "energy")
        if key in summary
    ]
    said = ", ".join(f"{k}: {v}" for k, v in summary["status"].items())
    share = 100 * summary["share_assemblable_free"]
    axes = [d for d in results.maps["energy"].dims if results.maps.sizes[d] > 1]
    picture = ""
    if len(axes) == 2:
        picture = html_figure(map_figure(results.maps), "Maps over the grid.")
    return (
        f"<h2>Over the workspace</h2><p>{html.escape(said)}. Assembles rigidly with "
        f"compliant joints free at {share:.1f} % of the points.</p>"
        + html_table(["", "least", "median", "largest"], rows)
        + picture
    )


def _picture(results: StudyResults) -> str:
    """The robot, deformed."""
    from assembly.plot import robot_plotter

    assert results.answer is not None
    plotter = robot_plotter(results.answer)
    pixels = plotter.screenshot(return_img=True)
    plotter.close()
    caption = "Nominal (grey) and forced robot; the exaggeration is on the picture."
    return "<h2>The forced robot</h2>" + html_image(png_bytes(pixels), caption)


def _crosscheck(results: StudyResults) -> str:
    """VJM against the multibody simulation."""
    from validation.plot import closing_figure, slope_figure

    check = results.crosscheck
    head = "<h2>Against a multibody simulation</h2><p>"
    if check is None:
        return f"{head}Not compared: {html.escape(results.crosscheck_failure)}</p>"
    closing = ""
    if results.closing is not None:
        drawn = closing_figure(check.posture, results.closing)
        closing = html_figure(
            drawn, "The simulation pulls the open robot shut by force."
        )
    return (
        head + "The same forced assembly, without "
        "clearances, as a geometrically nonlinear flexible multibody system (Exudyn). "
        "A linearised model must differ from it by the square of the errors' size: "
        f"slope 2. Measured: {check.slope:.3f}.</p>"
        + html_table(check.header(), check.rows())
        + html_figure(slope_figure(check), "Difference of the platform's pose.")
        + closing
    )


def _left_out() -> str:
    """What the model does not contain."""
    return (
        "<h2>What this leaves out</h2><p>Small screws: the closures are linear in "
        "them, and the cross-check above shows what that costs at these errors. Links "
        "act at their ends; no contact stiffness, friction, temperature or dynamics. "
        "The cross-check leaves the clearances out on both sides.</p>"
    )


def _number(value: float | None, digits: int = 6) -> str:
    """A number, or that there is none."""
    return "none" if value is None else f"{value:.{digits}g}"
