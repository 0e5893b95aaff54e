"""Assembly margins of a robot with given errors over a grid of postures."""

from collections import Counter
from collections.abc import Callable, Sequence
from hashlib import sha256
from importlib.metadata import version
from typing import Any

import numpy as np

from forcefit.assembly.kinematics.nominal import Target
from forcefit.assembly.kinematics.posture import Posture, place_many
from forcefit.assembly.kinematics.verdict import SINGULAR_WORDS, verdicts
from forcefit.assembly.linear.energy import CannotAssemble, solve_assembly
from forcefit.assembly.linear.zone import Compliant
from forcefit.assembly.model.joint_names import error_label
from forcefit.assembly.model.robot import Robot
from forcefit.assembly.model.statuses import OUT_OF_REACH, SINGULAR
from forcefit.assembly.solvers.conic import SolverFailed
from forcefit.assembly.statistics.posture_margins import prepare_margins
from forcefit.assembly.statistics.requirement import Plan
from forcefit.assembly.statistics.sensitivity import energy_slopes
from forcefit.assembly.sweeps.identity import program_hash, robot_hash
from forcefit.assembly.sweeps.targets import goals_of, grid_targets, parse_grid
from forcefit.inputs.table import BadInput


def grid_postures(robot: Robot, grid: str) -> tuple[list[Posture], dict[str, int]]:
    """Return the reachable and regular postures of a grid.

    Args:
        robot: the robot.
        grid: grid such as ``"tx=-0.2:0.2:0.1,tz=-0.5"``.

    Returns:
        The postures, and the number of omitted postures by status. The status is "out
        of reach" or that of :func:`forcefit.assembly.kinematics.verdict.verdicts`.

    Raises:
        BadInput: the grid is invalid, or the robot reaches none of its postures.
    """
    targets = grid_targets(parse_grid(grid))
    rows = targets.at(np.arange(int(np.prod(targets.shape))))
    goals = goals_of(targets.names, robot, rows)
    postures, reasons = place_many(robot, goals)
    reached = [p for p in postures if p is not None]
    if not reached:
        raise BadInput(
            "grid: found no posture that the robot reaches, expected at least "
            f"one; the first posture: {reasons[0]}"
        )
    said = verdicts(
        robot, Target(pose=goals[[p is not None for p in postures]]),
        np.array([p.coordinates for p in reached]),
        np.array([p.transforms for p in reached]),
    )  # fmt: skip
    usable = [p for p, (status, _) in zip(reached, said, strict=True) if not status]
    count = Counter(status for status, _ in said if status)
    count[OUT_OF_REACH] = len(postures) - len(reached)
    return usable, {status: n for status, n in count.items() if n}


def left_out_text(left_out: dict[str, int]) -> str:
    """Format the number of omitted postures by status as a line of text."""
    counts = ", ".join(f"{status}: {n}" for status, n in left_out.items())
    text = f"omitted postures: {counts}"
    if SINGULAR in left_out:
        text += f" ({SINGULAR_WORDS})"
    return text


def identity_of(postures: Sequence[Posture], plan: Plan, fresh: int) -> dict[str, Any]:
    """Return values that identify an allocation in a journal."""
    arrays = [p.transforms for p in postures]
    arrays += [v for v in vars(plan).values() if isinstance(v, np.ndarray)]
    arrays += plan.sources.identity
    digest = sha256(b"".join(np.ascontiguousarray(a).tobytes() for a in arrays))
    return {
        "robot_sha256": robot_hash(plan.sources.robot),
        "plan_and_postures_sha256": digest.hexdigest(),
        "limits": str(dict(plan.limits)),
        "cost": plan.cost,
        "clearance": plan.clearance,
        "contact_length": plan.contact_length or 0.0,
        "yield": plan.asked_yield,
        "draws": plan.draws,
        "seed": plan.seed,
        "fresh": fresh,
        "program": f"forcefit {version('forcefit')}",
        "program_sha256": program_hash(),
    }


def present_errors(
    postures: Sequence[Posture],
    compliant: Compliant = "free",
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> dict[str, Any]:
    """Compute the assembly margins for the errors in the robot file.

    Args:
        postures: postures of a robot with errors.
        compliant: whether compliant joints are ``"free"`` or ``"rigid"`` about their
            axis.
        progress: function called with the number of finished postures and the number of
            all postures.

    Returns:
        Margins of all postures, the largest margin and its posture, and the factor on
        all errors for which the largest margin is 1. Also, at this posture,
        derivatives of margin and energy with respect to each error, by decreasing
        effect on the margin.
    """
    prepared, zones = [], []
    for i, posture in enumerate(postures):
        prepared.append(prepare_margins(posture, compliant))
        zones.append(prepared[i].solve(posture.robot.errors[None]))
        progress(i + 1, len(postures))
    values = np.array([zone.margin[0] for zone in zones])
    worst = int(np.nanargmax(values))
    posture, margin = postures[worst], float(values[worst])
    robot = posture.robot
    slopes = prepared[worst].slopes(zones[worst])[0]
    try:
        assembly = solve_assembly(posture)
        energy, energies = assembly.energy, energy_slopes(assembly)
    except (CannotAssemble, SolverFailed):
        energy, energies = float("nan"), np.full_like(slopes, np.nan)
    present = np.argwhere(robot.errors != 0.0)
    effect = np.array([slopes[i, c] * robot.errors[i, c] for i, c in present])
    order = np.argsort(-np.nan_to_num(effect))
    return {
        "postures": len(postures),
        "quantity": "margin_free" if compliant == "free" else "margin",
        "largest_margin": margin,
        "margins": values,
        "at": posture.pose(),
        "factor_on_errors": 1.0 / margin if margin > 0 else float("inf"),
        "energy_there": energy,
        "assemblable_share": float(np.mean(values <= 1.0 + 1e-6)),
        "slopes": [
            {
                "error": error_label(robot, i, c),
                "value": robot.errors[i, c],
                "margin_slope": slopes[i, c],
                "share_of_margin": float(effect[k]) / margin if margin > 0 else 0.0,
                "energy_slope": energies[i, c],
            }
            for k in order.tolist() for i, c in [present[k].tolist()]
        ],
    }  # fmt: skip


def present_text(results: dict[str, Any]) -> str:
    """Format the results of :func:`present_errors` as text."""
    where = ", ".join(
        f"{k} = {v:.4g}" for k, v in results["at"].items() if abs(v) > 1e-9
    )
    lines = [
        f"{results['postures']} postures, {results['assemblable_share']:.1%} "
        f"assemble; largest margin {results['largest_margin']:.4g} "
        f"at {where or 'the origin'}",
        "all postures assemble if all errors are multiplied by "
        f"{results['factor_on_errors']:.4g}",
    ]
    for error in results["slopes"][:5]:
        lines.append(
            f"  {error['error']} = {error['value']:.3g} contributes "
            f"{error['share_of_margin']:.1%} to this margin"
        )
    return "\n".join(lines)
