"""The platform's stiffness of every draw: what errors and clearances spread it to.

Errors do not change the classical K_C.  What they change is which clearances are
pressed, so the tangent of (22) differs from draw to draw; and internal forces and
turned parts, which the tangent of the exact equilibrium has besides.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.exact.exact import solve_exact
from assembly.kinematics.posture import Posture
from assembly.linear.energy import CannotAssemble, solve_assembly
from assembly.linear.reduction import FreeMotion
from assembly.platform_stiffness.exact_tangent import exact_tangent
from assembly.platform_stiffness.linear_tangent import in_contact
from assembly.solvers.conic import SolverFailed
from assembly.statistics.estimates import mean, proportion, quantile
from stiffness.screws import WRENCH

STATES = {
    "contact": "tangent of (22), clearances free or pressed as they are",
    "exact": "tangent of the exact equilibrium, with its internal forces",
}


def draw_stiffnesses(
    posture: Posture, errors: NDArray, state: str,
    load: ArrayLike | None = None, gravity: ArrayLike | None = None,
) -> NDArray:  # fmt: skip
    """Stiffness along every axis, the others free, of each draw.

    Args:
        posture: where the robot stands.
        errors: (k, n, 6) [rad, m] of its frames.
        state: ``"contact"`` or ``"exact"``.
        load: (6,) [N m, N] on the platform at its origin, base axes.
        gravity: (3,) [m/s^2] base axes.

    Returns:
        (k, 6) [N m/rad, N/m] for ``[mx my mz fx fy fz]``; 0 where nothing resists, as
        within a clearance, NaN where there is no equilibrium.
    """
    stiffnesses = np.full((len(errors), 6), np.nan)
    for out, drawn in zip(stiffnesses, errors, strict=True):
        forced = replace(posture, robot=posture.robot.with_errors(drawn))
        try:
            if state == "exact":
                answer = solve_exact(forced, load, gravity=gravity)
                tangent = exact_tangent(answer, "letting go")
            else:
                linear = solve_assembly(forced, load, gravity=gravity)
                tangent = in_contact(linear, "letting go")
        except (CannotAssemble, FreeMotion, SolverFailed):
            continue
        out[:] = [tangent.along(axis)[0] for axis in np.eye(6)]
    return stiffnesses


def stiffness_report(stiffnesses: NDArray, state: str, level: float) -> dict[str, Any]:
    """Spread of the stiffness along each axis.

    Args:
        stiffnesses: (k, 6) of :func:`draw_stiffnesses`.
        state: of the tangents.
        level: of confidence.

    Returns:
        By axis: among how many draws with an answer, how often nothing resists, and of
        the rest mean and quantiles with intervals.
    """
    axes: dict[str, Any] = {}
    for name, values in zip(WRENCH, stiffnesses.T, strict=True):
        known = values[np.isfinite(values)]
        held = known[known > 0.0]
        axes[name.lower()] = {
            "unit": "N m/rad" if name.startswith("M") else "N/m",
            "draws": len(known),
            "free": proportion(len(known) - len(held), len(known), level),
        }  # fmt: skip
        if len(held) > 1:
            axes[name.lower()] |= {
                "mean": mean(held, level),
                "quantiles": {
                    str(q): quantile(held, q, level) for q in (0.05, 0.5, 0.95)
                },
            }
    return {"state": state, "means": STATES[state], "axes": axes}


def stiffness_spread_text(report: Mapping[str, Any]) -> str:
    """The spread for people, a line an axis."""
    lines = [f"stiffness of the platform, {report['means']}:"]
    for name, one in report["axes"].items():
        text = "nothing resists"
        if "quantiles" in one:
            low, half, high = (
                one["quantiles"][q]["value"] for q in ("0.05", "0.5", "0.95")
            )
            text = (
                f"median {half:.4g} {one['unit']}, 90 % within {low:.4g} to {high:.4g}"
            )
        free = one["free"]["probability"]
        lines.append(f"  {name}: {text}" + (f"; free in {free:.3g}" if free else ""))
    return "\n".join(lines)
