"""IPA's UR10: geometry, elasticity, and what the 0.4 mm are that stay.

    python -m examples.ipa_ur10.study [--data DIR] [-o ipa_ur10_study]

Fitted on the first half in time of series A and scored on its second half; fitted on
all of it and scored on series B, measured months later, with a new base and tool from
the first 200 rows there.
"""

import re
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from examples.calibration import (
    Fit,
    Rows,
    Term,
    calibrate,
    joint_springs,
    residuals,
    rows_of,
)
from examples.ipa_ur10.convert import JOINTS, convert
from examples.study_output import (
    arguments,
    print_table,
    rms_position,
    rms_rotation,
    run,
    write_results,
)
from validation.campaign.campaign_file import read_campaign

SIGMA = np.array([2e-4] * 3 + [1e-4] * 3)  # [rad, m] what a good model may leave
ORDERS = tuple(range(1, 41))  # cycles per turn of a joint
SPREADS = (3e-6, 1e-5, 3e-5)  # [rad] of one harmonic's coefficient, tried
BIN = 0.03  # [rad]
SERIES_TERM = re.compile(r"\.(cos|sin)\d+$")
SET_UP = 200  # rows of series B that place its base and tool


def harmonics(spread: float) -> Term:
    """Each joint's angle error, a Fourier series of its own angle.

    Equal spreads of all orders are a prior that knows nothing but a smallest width,
    1/40 of a turn: where a joint was never seen the error is zero.
    """

    def signature(rows: Rows) -> NDArray:
        q, turns = _angles(rows), _turns(rows)
        order = np.arange(1, ORDERS[-1] + 1)
        phase = q[..., None] * order
        series = np.stack([np.cos(phase), np.sin(phase)], axis=-1)
        product = turns[..., None, None] * series[:, :, None]  # (k, joint, 6, order, 2)
        return np.moveaxis(product, 1, 2).reshape(len(rows), 6, -1)

    names = [f"{j}.{f}{o}" for j in JOINTS for o in ORDERS for f in ("cos", "sin")]
    return Term(tuple(names), np.full(len(names), spread), signature)


def hysteresis() -> Term:
    """Each joint stops short, on the side from which it comes [rad]."""

    def signature(rows: Rows) -> NDArray:
        side = np.column_stack([rows.covariates[f"approach_{j}"] for j in JOINTS])
        return np.moveaxis(_turns(rows) * side[..., None], 1, 2)

    return Term(tuple(f"{j}.approach" for j in JOINTS), np.full(6, 1e-3), signature)


def _angles(rows: Rows) -> NDArray:
    """(k, 6) [rad] commanded."""
    at = [rows.here.robot.index(name) for name in JOINTS]
    return rows.here.coordinates[:, at]


def _turns(rows: Rows) -> NDArray:
    """(k, 6, 6) platform screws of unit turns of the joints, a row for each joint."""
    at = [rows.here.robot.index(name) for name in JOINTS]
    return rows.here.postures.paths[:, at][..., 2]


@dataclass(frozen=True)
class Step:
    """One model: which geometric errors are free, and which effects."""

    name: str
    free: str = "all"
    terms: tuple[Term, ...] = ()


def ladder(spread: float) -> tuple[Step, ...]:
    """The models, each the one before and one thing more."""
    springs = joint_springs({name: "z" for name in JOINTS[1:]}, 1e-4)
    bending = joint_springs({name: "xyz" for name in JOINTS}, 1e-4)
    approach = hysteresis()
    return (
        Step("nominal", "tool"),
        Step("+ joint offsets", "offsets"),
        Step("+ all geometric errors"),
        Step("+ elastic drives under gravity", terms=(springs,)),
        Step("+ joints give about all axes", terms=(bending,)),
        Step("+ direction of approach", terms=(bending, approach)),
        Step("+ angle errors of the joints", terms=(bending, approach,
                                                    harmonics(spread))),
    )  # fmt: skip


def free_errors(rows: Rows, which: str) -> NDArray:
    """(n, 6) prior spread of geometric errors: 10 mrad and 10 mm, the target's 0.1."""
    robot = rows.here.robot
    free = np.zeros((len(robot.frames), 6))
    if which == "all":
        free[:-1] = 1e-2
    if which == "offsets":
        free[[robot.index(name) for name in JOINTS[1:]], 2] = 1e-2
    free[-1] = 0.1
    return free


def fit_step(step: Step, rows: Rows) -> Fit:
    """A step fitted to some rows."""
    return calibrate(rows, free_errors(rows, step.free), step.terms, iterations=4)


def transfer(fit: Fit, rows: Rows) -> NDArray:
    """(k, 6) residuals of later rows; base and tool from the first ones."""
    first = np.arange(len(rows)) < SET_UP
    there = calibrate(rows.take(first), free_errors(rows, "tool"), (), fit, 4)
    return residuals(there, rows.take(~first))


def choose_spread(rows: Rows) -> float:
    """[rad] the spread that predicts the second half of some rows best."""
    first = np.arange(len(rows)) < len(rows) // 2
    tried = {}
    for spread in SPREADS:
        fit = fit_step(ladder(spread)[-1], rows.take(first))
        tried[spread] = rms_position(residuals(fit, rows.take(~first)))
    print("harmonics' spread [rad]: rms [mm]", {k: v * 1e3 for k, v in tried.items()})
    return min(tried, key=tried.__getitem__)


def joint_errors(fit: Fit, rows: Rows) -> NDArray:
    """(k, 6) [rad] the joints' errors that explain each row's residual best."""
    left = residuals(fit, rows)
    at = rows.of(fit.robot)
    R = fit.bases[0][:3, :3]
    screws = np.concatenate([left[:, :3] @ R, left[:, 3:] @ R], axis=1) / SIGMA
    J = np.moveaxis(_turns(at), 1, 2) / SIGMA[:, None]
    normal = np.swapaxes(J, 1, 2) @ J + np.eye(6) / 1e-3**2  # near singular wrists
    right = np.einsum("kij,ki->kj", J, screws)
    return np.linalg.solve(normal, right[..., None])[..., 0]


def agreement(one: tuple, other: tuple) -> list[float]:
    """Correlation of two series' error curves, joint by joint, in bins of angle.

    Args:
        one: angles and errors (k, 6) [rad] of a series.
        other: of the other.

    Returns:
        For each joint, over bins with at least five rows of both.
    """
    found = []
    for k in range(len(JOINTS)):
        edges = np.arange(-2 * np.pi, 2 * np.pi, BIN)
        means = []
        for q, e in (one, other):
            cell = np.digitize(q[:, k], edges)
            count = np.bincount(cell, minlength=len(edges) + 1)
            total = np.bincount(cell, e[:, k], minlength=len(edges) + 1)
            means.append(np.where(count >= 5, total / np.maximum(count, 1), np.nan))
        both = np.isfinite(means).all(axis=0)
        found.append(float(np.corrcoef(np.array(means)[:, both])[0, 1]))
    return found


def strongest(fit: Fit, joint: str) -> str:
    """The three largest orders of a joint's angle error, with amplitudes [mrad]."""
    value = {name: v for name, (v, _) in fit.named().items()}
    size = {
        o: np.hypot(value[f"{joint}.cos{o}"], value[f"{joint}.sin{o}"]) for o in ORDERS
    }
    best = sorted(size, key=size.__getitem__, reverse=True)[:3]
    return ", ".join(f"{o}: {size[o] * 1e3:.2f}" for o in best)


def main() -> None:
    """Convert, fit, score, draw."""
    options = arguments(__doc__, "ipa_ur10_study")
    series = {}
    for name, folder in convert(options.output, options.data).items():
        rows = rows_of(read_campaign(folder), np.array([0.0, 0.0, -9.81]))
        sigma = np.broadcast_to(SIGMA, rows.sigma.shape)
        series[name] = replace(rows, sigma=sigma)
    A, B = series["A"], series["B"]
    early = np.arange(len(A)) < len(A) // 2
    train, test = A.take(early), A.take(~early)
    spread = choose_spread(train)
    steps, found = [], {}
    for step in ladder(spread):
        fit = found[step.name] = fit_step(step, train)
        whole = transfer(fit_step(step, A), B)
        left = (residuals(fit, train), residuals(fit, test), whole)
        steps.append({
            "model": step.name,
            "position": [rms_position(r) for r in left],
            "rotation": [rms_rotation(r) for r in left],
            "parameters": {
                k: v for k, v in fit.named().items() if not SERIES_TERM.search(k)
            },
        })  # fmt: skip
    _print(steps)
    write_results(options.output, {"unit": "m, rad", "spread": spread, "steps": steps})
    from examples.ipa_ur10.figure import draw

    elastic = found["+ joints give about all axes"]
    last = found["+ angle errors of the joints"]
    there = calibrate(B, free_errors(B, "tool"), (), elastic, 4)
    errors = {
        "series A": (_angles(A), joint_errors(elastic, A)),
        "series B": (_angles(B), joint_errors(there, B)),
    }
    after = joint_errors(last, test)
    alike = agreement(*errors.values())
    print("\njoint: error rms [mrad], left by its series (second half); A and B")
    print("correlated; largest orders [cycles/turn: mrad]")
    for k, name in enumerate(JOINTS):
        before = errors["series A"][1][~early, k]
        print(
            f"  {name:20s} {before.std() * 1e3:.3f}  {after[:, k].std() * 1e3:.3f}  "
            f"{alike[k]: .2f}  {strongest(last, name)}"
        )
    draw(errors, options.output)


def _print(steps: list[dict]) -> None:
    """Both tables, mm and mrad."""
    header = ("model", "A, first half (fitted)", "A, second half", "B, new set-up")
    for key, unit in (("position", "mm"), ("rotation", "mrad")):
        rows = [(s["model"], *(x * 1e3 for x in s[key])) for s in steps]
        print_table(f"rms {key} error [{unit}]", header, rows)
    print("\ndirection of approach [rad]")
    for name, (value, std) in steps[-1]["parameters"].items():
        if name.endswith(".approach"):
            print(f"  {name:32s} {value: .1e} +- {std:.0e}")


if __name__ == "__main__":
    run(main)
