"""Hilti's construction robot: what its declared model lacks, step by step.

    python -m examples.hilti.study [--data DIR] [-o hilti_study]

Fitted on ``flat``; scored on the evaluation points of ``pallet`` and
``orthogonal_wood``, whose base pose comes from their stationing points alone.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from examples.calibration import (
    Fit,
    Rows,
    Signature,
    Term,
    calibrate,
    joint_springs,
    residuals,
    rows_of,
)
from examples.hilti.convert import ARM, FILES, SEGMENTS, G, convert
from examples.study_output import (
    arguments,
    print_table,
    rms_position,
    run,
    write_results,
)
from validation.campaign.campaign_file import read_campaign

LOWER, UPPER = SEGMENTS
REACH = {LOWER: 1.448, UPPER: 1.414}  # [m] overlap at zero, README of the data
TAKEN_UP = 20.0  # [N m] beyond which the column's play lies on one side
BENDING = {name: "xyz" for name in ARM[:4]}


def column_elasticity() -> Term:
    """Tilt of each segment in its guide: moment / (k overlap^2), k the same in both."""
    return Term(("column.x", "column.y"), np.full(2, 1e-4), _column(2, play=False))


def column_clearance() -> Term:
    """Play / overlap, to the side to which the moment pulls."""
    return Term(("play.x", "play.y"), np.full(2, 1e-2), _column(1, play=True))


def _column(power: int, play: bool) -> Signature:
    """Signature of tilts about the two horizontal axes, in both overlaps."""

    def signature(rows: Rows) -> NDArray:
        moments, total = rows.joint_wrenches(), np.zeros((len(rows), 6, 2))
        for name in SEGMENTS:
            centre, axes, overlap = _guide(rows, name)
            m = moments[:, rows.here.robot.index(name), :2]
            if play:
                m = m / np.hypot(np.hypot(m[:, :1], m[:, 1:]), TAKEN_UP)
            tilt = m / overlap[:, None] ** power
            total = total + rows.turned_about(centre, axes)[:, :, :2] * tilt[:, None]
        return total

    return signature


def _guide(rows: Rows, name: str) -> tuple[NDArray, NDArray, NDArray]:
    """Centre (k, 3), axes (k, 3, 3) and length (k,) of an overlap."""
    i = rows.here.robot.index(name)
    travel = rows.here.coordinates[:, i]
    T = rows.here.transforms[:, i]
    overlap = REACH[name] - travel
    # the inner segment's foot stands at its travel, the overlap begins there
    up = (travel + overlap / 2)[:, None]
    return T[:, :3, 3] + T[:, :3, 2] * up, T[:, :3, :3], overlap


def measured_tilt(level: NDArray) -> Term:
    """The tilt the two accelerometers see, half in either overlap; 1 is expected."""

    def signature(rows: Rows) -> NDArray:
        tilt = _tilt(rows) - level
        centres = [_guide(rows, name)[0] for name in SEGMENTS]
        axes = np.broadcast_to(np.eye(3), (len(rows), 3, 3))
        middle = np.mean(centres, axis=0)
        return rows.turned_about(middle, axes)[:, :, :2] * tilt[:, None]

    return Term(("tilt.x", "tilt.y"), np.full(2, 3.0), signature)


def _up(rows: Rows, place: str) -> NDArray:
    """(k, 3) unit vector up, as an accelerometer sees it."""
    return np.column_stack([rows.covariates[f"up_{place}_{a}"] for a in "xyz"])


def _tilt(rows: Rows) -> NDArray:
    """(k, 2) [rad] turn of the column's tip against its base, about x and y."""
    turned = _up(rows, "column") - _up(rows, "base")
    return np.column_stack([turned[:, 1], -turned[:, 0]])


@dataclass(frozen=True)
class Step:
    """One model of the ladder."""

    name: str
    terms: tuple[Term, ...] = ()
    geometry: bool = True
    gravity: bool = False
    zero: str = ""  # an arm joint whose zero is fitted anew to each set-up


@dataclass(frozen=True, eq=False)
class Score:
    """Rms of the prism's position [m] and the residuals [m] behind it."""

    fit: Fit
    flat: float
    stationing: dict[str, float]
    evaluation: dict[str, float]
    left: dict[str, NDArray]


def spreads(rows: Rows, geometry: bool) -> NDArray:
    """(n, 6) prior spread of the geometric errors: 5 mrad, 5 mm; the prism's 50 mm."""
    free = np.zeros((len(rows.here.robot.frames), 6))
    if geometry:
        free[1:] = 5e-3
    free[-1] = [0, 0, 0, 0.05, 0.05, 0.05]
    return free


def score(step: Step, sets: dict[str, Rows]) -> Score:
    """Fit a step on ``flat``, set up the other files, score all."""
    flat = sets["flat"]
    fit = calibrate(flat, spreads(flat, step.geometry), step.terms)
    stationing, evaluation, left = {}, {}, {}
    for name in FILES[1:]:
        rows = sets[name]
        known = rows.covariates["stationing"] == 1
        here = set_up(fit, rows.take(known), step.zero)
        stationing[name] = rms_position(residuals(here, rows.take(known)))
        left[name] = residuals(here, rows.take(~known))[:, 3:]
        evaluation[name] = rms_position(residuals(here, rows.take(~known)))
    own = rms_position(residuals(fit, flat))
    return Score(fit, own, stationing, evaluation, left)


def set_up(fit: Fit, rows: Rows, zero: str = "") -> Fit:
    """A base pose, and the zero of one joint if named, from stationing points."""
    free = np.zeros((len(fit.robot.frames), 6))
    if zero:
        free[fit.robot.index(zero), 2] = 5e-3
    return calibrate(rows, free, (), fit, 4)


def with_true_gravity(sets: dict[str, Rows], fit: Fit) -> dict[str, Rows]:
    """Gravity as the base's accelerometer sees it, row by row.

    The sensor's own alignment is what makes ``flat`` agree with the total station,
    whose z axis is vertical.
    """
    seen = _up(sets["flat"], "base").mean(axis=0)
    level = fit.bases[0][:3, :3].T @ [0.0, 0.0, 1.0] - seen
    turned = {}
    for name, rows in sets.items():
        up = _up(rows, "base") + level
        g = -G * up / np.linalg.norm(up, axis=1)[:, None]
        turned[name] = replace(rows, here=replace(rows.here, gravity=g))
    return turned


def leave_one_height_out(step: Step, flat: Rows) -> float:
    """[m] rms on ``flat``, each column height predicted from the others."""
    height, errors = flat.covariates["height"], []
    for one in np.unique(height):
        rest = flat.take(height != one)
        fit = calibrate(rest, spreads(flat, step.geometry), step.terms)
        errors.append(residuals(fit, flat.take(height == one)))
    return rms_position(np.concatenate(errors))


def ladder(level: NDArray) -> tuple[Step, ...]:
    """The models, each the one before and one thing more."""
    column, play = column_elasticity(), column_clearance()
    springs = joint_springs({name: "z" for name in ARM[:4]}, 1e-3)
    bending, tilt = joint_springs(BENDING, 1e-3), measured_tilt(level)
    return (
        Step("URDF, prism offset", geometry=False),
        Step("+ geometric errors"),
        Step("+ column elasticity", (column,)),
        Step("+ joint springs", (column, springs)),
        Step("+ clearance in the overlaps", (column, springs, play)),
        Step("+ true gravity direction", (column, springs, play), gravity=True),
        Step("column's tilt measured instead", (tilt, springs), gravity=True),
        Step("+ joints give about all axes", (tilt, bending), gravity=True),
    )


def main() -> None:
    """Convert, fit, score, draw."""
    options = arguments(__doc__, "hilti_study")
    folders = convert(options.output, options.data)
    sets = {
        name: rows_of(read_campaign(folder), np.array([0.0, 0.0, -G]))
        for name, folder in folders.items()
    }
    scores: dict[str, Score] = {}
    inside: dict[str, float] = {}
    true = sets
    for step in ladder(_tilt(sets["flat"]).mean(axis=0)):
        if step.gravity and true is sets:
            true = with_true_gravity(sets, scores["+ joint springs"].fit)
        used = true if step.gravity else sets
        scores[step.name] = score(step, used)
        inside[step.name] = leave_one_height_out(step, used["flat"])
        last = step
    # which joint's zero moved between the days is read from stationing points alone
    trials = {joint: score(replace(last, zero=joint), true) for joint in ARM}
    best = min(trials, key=lambda j: sum(v**2 for v in trials[j].stationing.values()))
    scores[f"+ zero of {best} at each set-up"] = trials[best]
    _print(scores, inside, trials)
    _save(options.output, scores, inside, trials, best)
    from examples.hilti.figure import draw

    rows = {name: r.take(r.covariates["stationing"] == 0) for name, r in true.items()}
    draw(scores, rows, options.output)


def _print(scores: dict[str, Score], inside: dict, trials: dict) -> None:
    """The ladder in mm, and the last step's parameters."""
    print_table(
        "rms of the prism's position [mm]",
        ("model", "flat (fitted)", "flat, height out", *FILES[1:]),
        [
            (
                name, s.flat * 1e3, inside.get(name, float("nan")) * 1e3,
                *(s.evaluation[f] * 1e3 for f in FILES[1:]),
            )
            for name, s in scores.items()
        ],
    )  # fmt: skip
    print_table(
        "zero of one arm joint fitted at each set-up, rms at STATIONING points [mm]",
        ("joint", *FILES[1:]),
        [(j, *(s.stationing[f] * 1e3 for f in FILES[1:])) for j, s in trials.items()],
    )
    for name in ("+ true gravity direction", "column's tilt measured instead"):
        print(f"\n{name}")
        for key, (value, std) in scores[name].fit.named().items():
            print(f"  {key:14s} {value: .3e} +- {std:.0e}")


def _save(out: Path, scores: dict, inside: dict, trials: dict, best: str) -> None:
    """Everything the tables show, in SI."""
    steps = [
        {
            "model": name, "flat": s.flat, "flat_height_out": inside.get(name),
            "evaluation": s.evaluation, "stationing": s.stationing,
            "parameters": s.fit.named(),
        }
        for name, s in scores.items()
    ]  # fmt: skip
    chosen = {j: s.stationing for j, s in trials.items()}
    write_results(
        out, {"unit": "m", "steps": steps, "zero_chosen": best, "zero_trials": chosen}
    )


if __name__ == "__main__":
    run(main)
