"""Solve problems (21) and (22) of the paper in cvxpy, without reformulation."""

import math
from typing import Any

from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.linear.energy import Assembly
from forcefit.assembly.model.statuses import (
    FAILED,
    FAILS,
    NO_ANSWER,
    NO_SIGNAL,
    OK,
    PASSED,
    UNDECIDED,
)
from forcefit.validation.crosscheck.verdict import Check

TOLERANCE = 1e-6  # [-] relative tolerance of energies and margins
# Rounding errors of energies [J] and margins [-] in cvxpy.
_NOISE_ENERGY, _NOISE_MARGIN = 1e-12, 1e-10


def compare_printed(
    posture: Posture, assembly: Assembly, zone: dict[str, Any]
) -> dict[str, Any]:
    """Solve problems (21) and (22) in cvxpy, and compare energy and margins.

    Args:
        posture: the robot's configuration.
        assembly: solution computed by forcefit, without loads.
        zone: ``margin`` and ``margin_free`` computed by forcefit.

    Returns:
        Plain values: ``energy``, ``platform_screw``, ``margin`` and ``margin_free``
            computed by cvxpy, the ``relative_difference`` of each quantity, the verdict
            of each comparison (``checks``), ``verdict`` and ``passed``.  Differences
            are NaN if there is nothing to compare.  If cvxpy finds no solution, the
            mapping contains only the ``reason``.
    """
    from forcefit.assembly.linear.reference.as_printed import (
        energy_as_printed,
        margin_as_printed,
    )

    try:
        energy, screw = energy_as_printed(posture)
        margin, free = (margin_as_printed(posture, free) for free in (False, True))
    except RuntimeError as error:
        return {"verdict": NO_ANSWER, "passed": False, "reason": str(error)}
    checks = {
        "energy": _energy_check(assembly, energy),
        "margin": _margin_check(zone["margin"], margin),
        "margin_free": _margin_check(zone["margin_free"], free),
    }
    outcomes = {check.verdict for check in checks.values()}
    bad, some = bool(outcomes & {FAILS, UNDECIDED}), OK in outcomes
    return {
        "energy": energy,
        "platform_screw": screw,
        "margin": margin,
        "margin_free": free,
        "relative_difference": {
            name: check.value if check.verdict != NO_SIGNAL else math.nan
            for name, check in checks.items()
        },
        "tolerance": TOLERANCE,
        "checks": {name: check.verdict for name, check in checks.items()},
        "verdict": FAILED if bad else PASSED if some else NO_SIGNAL,
        "passed": some and not bad,
    }


def _energy_check(assembly: Assembly, energy: float) -> Check:
    """Return the check that both energies agree."""
    tight = assembly.energy_without_clearance
    scale = max(assembly.energy, 1e-6 * tight, _NOISE_ENERGY / TOLERANCE)
    return Check(
        abs(energy - assembly.energy) / scale, TOLERANCE,
        signal=max(assembly.energy, tight) >= _NOISE_ENERGY / TOLERANCE,
    )  # fmt: skip


def _margin_check(ours: float | None, theirs: float | None) -> Check:
    """Return the check that two margins agree."""
    if ours is None or theirs is None:
        value = 0.0 if ours is theirs else math.inf
        return Check(value, TOLERANCE, signal=False)
    scale = max(abs(ours), abs(theirs), _NOISE_MARGIN / TOLERANCE)
    signal = scale > _NOISE_MARGIN / TOLERANCE
    return Check(abs(ours - theirs) / scale, TOLERANCE, signal=signal)
