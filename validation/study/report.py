"""Write a study's report as a self-contained HTML page, and its results as JSON."""

from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from forcefit.assembly.linear.assembled import Assembly, without_rounding
from forcefit.assembly.linear.zone import ASSEMBLABLE
from forcefit.assembly.model.contact_closures import loops
from forcefit.assembly.model.joint_names import joint_of
from forcefit.assembly.model.statuses import FAILED, OK, PASSED
from forcefit.inputs.table import BadInput
from forcefit.inputs.writing import write_json, write_text
from forcefit.page.page import Page, Provenance, Tile, command_line, page
from forcefit.page.tables import Value, rotation_and_translation
from forcefit.results.display import largest_row
from forcefit.results.quantities import in_words
from forcefit.validation.study.drawn_section import drawn_section, drawn_tiles
from forcefit.validation.study.headline import (
    by_force,
    conclusions,
    covered,
    worst_clearance,
)
from forcefit.validation.study.map_section import finite, mapped, maps_section
from forcefit.validation.study.platform_section import platform_section
from forcefit.validation.study.sections import (
    crosscheck_section,
    governing_section,
    reference_section,
    robot_section,
    solution_section,
    stiffness_section,
    unchecked_section,
)
from forcefit.validation.study.service_section import service_section, service_tile
from forcefit.validation.study.study import StudyResults, points_solved

_ASSUMED = (
    "Motions are small: closures are linearised; the linearisation error and the "
    "cross-check show the error of this assumption.",
    "Links are elastic between their ends; no contact stiffness, friction, temperature "
    "or dynamics.",
    "Both models of the cross-check have no clearances.",
    "Results between the points of a grid are not certified.",
)


def write_study(results: StudyResults) -> Path:
    """Write ``report.html``, ``results.json`` and ``results.nc`` of a study.

    Args:
        results: result of :func:`forcefit.validation.study.study.run_study`.

    Returns:
        Path of the folder.

    Raises:
        BadInput: the folder cannot be written.
    """
    from forcefit.assembly.sweeps.dataset import save_dataset

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
    """Convert the results of a study to plain values."""
    table: dict[str, Any] = {
        "program": f"forcefit {version('forcefit')}",
        "title": results.study.title,
        "errors": results.study.errors,
        "links": results.study.source,
        "passed": results.passed,
        "verdicts": results.verdicts,
        "unchecked": results.unchecked,
        "worst_clearance": worst_clearance(results),
        "solution": results.solution,
        "error": results.error,
        "reference": results.reference,
        "stiffness": results.stiffness,
        "platform_stiffness": results.platform_stiffness,
        "governing": results.governing,
        "service": results.service,
    }
    if results.statistics is not None:
        table["statistics"] = results.statistics
    if results.crosscheck is not None:
        table["crosscheck"] = results.crosscheck.table()
    elif results.crosscheck_failure:
        table["crosscheck"] = {"passed": False, "reason": results.crosscheck_failure}
    if results.maps is not None:
        table["maps"] = map_summary(results.maps)
    return table


def map_summary(maps: Any) -> dict[str, Any]:
    """Return the minimum, median and maximum of each map, and the status counts."""
    names, counts = np.unique(maps["status"].values.astype(str), return_counts=True)
    summary: dict[str, Any] = {"status": dict(zip(names, counts.tolist(), strict=True))}
    for one in mapped(maps):
        values = finite(one)
        if len(values):
            summary[one.key] = [values.min(), float(np.median(values)), values.max()]
    solved = points_solved(maps)
    share = int((maps["margin_free"] <= ASSEMBLABLE).sum()) / solved if solved else None
    return summary | {"share_assemblable_free": share}


def report_page(results: StudyResults) -> str:
    """Create the report as a self-contained HTML page."""
    study, robot = results.study, results.robot
    body = [
        unchecked_section(results),
        robot_section(results),
        governing_section(results),
        drawn_section(results),
        maps_section(results.maps, map_summary(results.maps))
        if results.maps is not None
        else "",
        solution_section(results),
        service_section(results.service),
        platform_section(results.platform_stiffness),
        reference_section(results),
        stiffness_section(results),
        crosscheck_section(results),
    ]
    described = (
        f"{robot.name}: {robot.description}" if robot.description else robot.name
    )
    closed = len(loops(robot))
    about = (
        f"{described}. {len(robot.frames)} frames, {closed} "
        f"closure{'' if closed == 1 else 's'}; {study.errors}; link stiffness: "
        f"{study.source}."
    )
    command = command_line()
    return page(
        Page(
            title=study.title,
            verdict=_verdict(results),
            good=_good(results),
            tiles=_tiles(results),
            about=about,
            body=body,
            assumed=[f"{study.errors[0].upper()}{study.errors[1:]}.", *_ASSUMED],
            provenance=Provenance(command, study.files),
            results=results_table(results),
            details=" ".join(conclusions(results)[1:]),
        )
    )


def _verdict(results: StudyResults) -> str:
    """Return a sentence on the assembly and the checks that did not pass."""
    first = conclusions(results)[0].removesuffix(".")
    missed = [
        f"{in_words(name)} {outcome}"
        for name, outcome in results.verdicts.items()
        if outcome != PASSED
    ]
    return f"{'; '.join([first, *missed])}."


def _good(results: StudyResults) -> bool | None:
    """Return whether the robot assembles without force and all checks passed.

    The result is None if assembly requires force or a check has no outcome.  It is
    False if there is no solution or a check failed.
    """
    if results.solution["status"] != OK or FAILED in results.verdicts.values():
        return False
    return True if results.passed and not by_force(results) else None


def _tiles(results: StudyResults) -> list[Tile]:
    """Return the tiles of the report."""
    if results.assembly is None:
        return [Tile("Assembly", [results.solution["status"]])]
    worst, study_robot = worst_clearance(results), results.robot
    tiles = []
    if worst["pose"] is not None:
        over = worst["map"]
        bounds = [
            rotation_and_translation(one["rotation"], one["translation"], 3)
            for one in (worst["pose"], over) if one is not None
        ]  # fmt: skip
        drawn = study_robot.callouts or study_robot.fits
        tiles += drawn_tiles(results.statistics, worst)
        title = "Worst case of given parts" if tiles else "Certified worst case"
        tiles.append(Tile(title, bounds[0], [
            "Over all positions within the clearances, at this pose",
            *(["; over the map ", *bounds[1]] if over is not None else []), ".",
            " Drawing tolerances are excluded." if drawn else "",
        ]))  # fmt: skip
        tiles += _governing_tiles(results, worst["pose"])
    tiles.append(_force_tile(results.assembly))
    tiles += service_tile(results.service)
    passed = sum(v == "passed" for v in results.verdicts.values())
    note = [f"{'; '.join(covered(results))}. " if covered(results) else ""]
    if results.unchecked:
        note.append(f"Not checked: {', '.join(results.unchecked)}.")
    answer = f"{passed} of {len(results.verdicts)} passed"
    return [*tiles, Tile("Independent checks", [answer], note)]


def _force_tile(assembly: Assembly) -> Tile:
    """Return the tile of the largest moment and the largest force of all bodies."""
    wrenches = without_rounding(assembly.tip_wrenches)
    shown: list[str | Value] = []
    names = []
    for part, unit in ((slice(0, 3), "N m"), (slice(3, 6), "N")):
        sizes = np.linalg.norm(wrenches[:, part], axis=1)
        row = largest_row(sizes)
        names.append(joint_of(assembly.posture.robot, row))
        shown += [" and " if shown else "", Value(float(sizes[row]), unit)]
    return Tile("Moment and force of assembly", shown, [
        f"Largest values through a body, at {names[0]} and {names[1]}; energy ",
        Value(assembly.energy, "J"), ".",
    ])  # fmt: skip


def _governing_tiles(results: StudyResults, worst: dict[str, float]) -> list[Tile]:
    """Return tiles of the largest imperfection and of the tolerance to tighten."""
    known = [
        one for one in results.governing
        if one["translation"] is not None and np.isfinite(one["translation"])
    ]  # fmt: skip
    whole = worst["translation"]
    if not known or not np.isfinite(whole) or whole == 0.0:
        return []
    best = known[0]
    won = 1 - best["translation"] / whole
    if won < 0.01:
        none = "No single part changes the worst case by 1 % or more."
        return [Tile("Governing part", ["many parts"], [none])]
    further = ", ".join(
        f"{one['part']} ({one['what']}, {_percent(one['translation'] / whole)})"
        for one in known[1:4]
        if one["translation"] < 0.99 * whole
    )
    return [
        Tile("Governing part", [best["part"]], [f"its {best['what']}."]),
        Tile("Tolerance to tighten", [f"{best['part']}: {-100 * won:.0f} %"], [
            f"without its {best['what']} the worst case is ",
            Value(best["translation"], "m"), f"; then {further}." if further else ".",
        ]),
    ]  # fmt: skip


def _percent(ratio: float) -> str:
    """Format a factor as a relative change in per cent."""
    return f"{100 * (ratio - 1):+.0f} %"
