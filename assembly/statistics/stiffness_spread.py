"""Distribution of the platform stiffness for random geometric errors.

Errors determine which joints are in contact within their clearances. Therefore, the
tangent stiffness of problem (22) differs between draws. The tangent stiffness of the
exact equilibrium also depends on internal forces and on rotations of the bodies.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.assembly.exact.exact import solve_exact
from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.linear.energy import CannotAssemble, solve_assembly
from forcefit.assembly.linear.reference.reduction import FreeMotion
from forcefit.assembly.platform_stiffness.exact_tangent import exact_tangent
from forcefit.assembly.platform_stiffness.linear_tangent import in_contact
from forcefit.assembly.solvers.conic import SolverFailed
from forcefit.assembly.statistics.estimates import mean, proportion, quantile
from forcefit.assembly.sweeps.point_stiffness import STATES
from forcefit.results.display import numbers
from forcefit.stiffness.screws import WRENCH

_NAMED = 5  # largest number of reported free motions
_ALIKE = 2  # number of decimals to which equal motions agree


def draw_stiffnesses(
    posture: Posture, errors: NDArray, state: str,
    load: ArrayLike | None = None, gravity: ArrayLike | None = None,
) -> tuple[NDArray, NDArray]:  # fmt: skip
    """Compute the platform stiffness along each axis, with the other axes free.

    Args:
        posture: the robot's configuration.
        errors: (k, n, 6) [rad, m] errors of the frames.
        state: ``"contact"`` or ``"exact"``.
        load: (6,) [N m, N] load on the platform at its origin, base axes.
        gravity: (3,) [m/s^2] gravity in base axes.

    Returns:
        Stiffnesses along ``[mx my mz fx fy fz]``, (k, 6) [N m/rad, N/m]: 0 along a free
        motion and NaN without an equilibrium. Unit screws of the free motions, (k, 6,
        6) [rad, m], in rows; unused rows are NaN.
    """
    stiffnesses = np.full((len(errors), 6), np.nan)
    motions = np.full((len(errors), 6, 6), np.nan)
    for out, free, drawn in zip(stiffnesses, motions, errors, strict=True):
        forced = replace(posture, robot=posture.robot.with_errors(drawn))
        try:
            if state == "exact":
                answer = solve_exact(forced, load, gravity=gravity)
                tangent = exact_tangent(answer, "unloading")
            else:
                linear = solve_assembly(forced, load, gravity=gravity)
                tangent = in_contact(linear, "unloading")
        except (CannotAssemble, FreeMotion, SolverFailed):
            continue
        out[:] = [tangent.along(axis)[0] for axis in np.eye(6)]
        free[: tangent.free.shape[1]] = tangent.free.T
    return stiffnesses, motions


def stiffness_report(
    stiffnesses: NDArray, motions: NDArray, state: str, level: float
) -> dict[str, Any]:
    """Summarise the distribution of the stiffness along each axis.

    Args:
        stiffnesses: (k, 6) result of :func:`draw_stiffnesses`.
        motions: (k, 6, 6) free motions from the same function.
        state: state in which the stiffness was computed, ``"contact"`` or ``"exact"``.
        level: confidence level.

    Returns:
        For each axis, the number of draws with a result, the fractions of draws with
        zero and with infinite stiffness, and mean and quantiles of the other draws.
        Also the most frequent free motions.
    """
    axes: dict[str, Any] = {}
    for name, values in zip(WRENCH, stiffnesses.T, strict=True):
        known = values[~np.isnan(values)]
        held = known[(known > 0.0) & np.isfinite(known)]
        axes[name.lower()] = {
            "unit": "N m/rad" if name.startswith("M") else "N/m",
            "draws": len(known),
        }
        for share, there in (("free", known == 0.0), ("rigid", np.isinf(known))):
            if len(known) and (share == "free" or there.any()):
                found = proportion(int(there.sum()), len(known), level)
                axes[name.lower()][share] = found
        if len(held) > 1:
            axes[name.lower()] |= {
                "mean": mean(held, level),
                "quantiles": {
                    str(q): quantile(held, q, level) for q in (0.05, 0.5, 0.95)
                },
            }
    free = motions[np.isfinite(motions).all(axis=2)].round(_ALIKE) + 0.0
    screws, counts = np.unique(free, axis=0, return_counts=True)
    most = np.argsort(-counts, kind="stable")[:_NAMED]
    return {
        "state": state, "means": STATES[state], "axes": axes,
        "free_motions": [
            {"screw": screws[i], "draws": int(counts[i])} for i in most.tolist()
        ],
    }  # fmt: skip


def stiffness_spread_text(report: Mapping[str, Any]) -> str:
    """Format the distribution as text with one line per axis."""
    lines = [f"stiffness of the platform, {report['means']}:"]
    for name, one in report["axes"].items():
        shares = {
            share: one[share]["probability"]
            for share in ("free", "rigid")
            if share in one and one[share]["probability"]
        }
        text = "no finite stiffness" if "rigid" in shares else "no resistance"
        if "quantiles" in one:
            low, half, high = (
                one["quantiles"][q]["value"] for q in ("0.05", "0.5", "0.95")
            )
            text = (
                f"median {half:.4g} {one['unit']}, 90 % within {low:.4g} to {high:.4g}"
            )
        also = [f"{share} in {value:.3g}" for share, value in shares.items()]
        lines.append(f"  {name}: {'; '.join([text, *also])}")
    for one in report["free_motions"]:
        screw = numbers(one["screw"])
        lines.append(
            f"  the platform moves freely along {screw} [rad, m] in "
            f"{one['draws']} draws"
        )
    return "\n".join(lines)
