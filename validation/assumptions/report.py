"""Convert the errors caused by modelling assumptions to plain values and text."""

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.model.statuses import OUT_OF_REACH
from forcefit.validation.assumptions.over_poses import CostsOverPoses
from forcefit.validation.assumptions.platform_cost import PlatformCosts
from forcefit.validation.assumptions.validity import ENERGY_LIMIT, POSITION_LIMIT, Cost

# Names of the compared models for each error in platform compliance.
COMPARED = {
    "beams": "beams, not solids",
    "meshed": "meshed K_E, not solids",
    "ends": "rigid ends, compared with wrenches spread over them",
}
_LIMITS = {"position": POSITION_LIMIT, "energy": ENERGY_LIMIT}
_NAMED = 3  # largest number of links in the text
_Pose = Mapping[str, float]


def costs_table(costs: CostsOverPoses) -> dict[str, Any]:
    """Return the errors at one pose, or the reasons why they are unknown."""
    return {
        "robot": costs.robot.name, "pose": costs.asked[0], "limits": _LIMITS,
        **_at(costs, 0),
    }  # fmt: skip


def over_poses_table(costs: CostsOverPoses) -> dict[str, Any]:
    """Return the errors at every pose, their medians and their maxima."""
    poses: list[dict[str, Any]] = []
    for asked, why in zip(costs.asked, costs.unreached, strict=True):
        row: dict[str, Any] = {"asked": asked, "status": "ok"}
        if why:
            row |= {"status": OUT_OF_REACH, "reason": why}
        else:
            row |= _at(costs, sum(earlier["status"] == "ok" for earlier in poses))
        poses.append(row)
    platform: dict[str, Any] = {"reason": costs.platform}
    if isinstance(costs.platform, PlatformCosts):
        platform = _platform(
            costs.platform, lambda values: spread(values, costs.reached)
        )
    return {
        "robot": costs.robot.name, "reached": len(costs.reached), "limits": _LIMITS,
        "costs": {name: _summary(costs, name) for name in costs.assumptions},
        "platform": platform, "poses": poses,
    }  # fmt: skip


def _at(costs: CostsOverPoses, i: int) -> dict[str, Any]:
    """Return the errors at the i-th reachable pose."""
    platform: dict[str, Any] = {"reason": costs.platform}
    if isinstance(costs.platform, PlatformCosts):
        platform = _platform(costs.platform, lambda values: values[i])
    rows = {name: _values(cost) for name, cost in costs.costs[i].items()}
    return {"costs": rows, "platform": platform}


def _values(cost: Cost | str) -> dict[str, Any]:
    """Return an error as plain values, or the reason why it is unknown."""
    if isinstance(cost, str):
        return {"reason": cost}
    values = {k: v for k, v in vars(cost).items() if v is not None}
    return {**values, "matters": cost.matters}


def _platform(costs: PlatformCosts, shown: Callable[[NDArray], Any]) -> dict[str, Any]:
    """Return the largest errors in platform compliance over all wrenches."""
    return {
        "compliance": {name: shown(getattr(costs, name)) for name in COMPARED},
        "by_link": {name: shown(values) for name, values in costs.by_link.items()},
        "without_shape": list(costs.left), "mesh_error": costs.mesh_error,
    }  # fmt: skip


def spread(values: NDArray, where: Sequence[_Pose]) -> dict[str, Any]:
    """Return the median of finite values, their maximum, and its pose."""
    known = np.isfinite(values)
    if not known.any():
        return {"median": np.nan, "largest": np.nan, "at": None}
    return {
        "median": float(np.median(values[known])),
        "largest": float(values[known].max()), "at": where[int(np.nanargmax(values))],
    }  # fmt: skip


def _summary(costs: CostsOverPoses, name: str) -> dict[str, Any]:
    """Return a summary of the errors of one assumption over all poses."""
    pairs = [
        (asked, at[name]) for asked, at in zip(costs.reached, costs.costs, strict=True)
    ]
    known = [(asked, cost) for asked, cost in pairs if isinstance(cost, Cost)]
    where = [asked for asked, _ in known]
    return {
        "known": len(known), "matters": sum(cost.matters for _, cost in known),
        **{key: spread(np.array([getattr(cost, key) for _, cost in known]), where)
           for key in ("position", "rotation", "energy")},
        "reasons": dict(Counter(cost for _, cost in pairs if isinstance(cost, str))),
    }  # fmt: skip


def costs_text(costs: CostsOverPoses) -> str:
    """Format the errors at one pose as text, one line per assumption."""
    lines = [f"{costs.robot.name}: errors due to the model's assumptions"]
    for name, cost in costs.costs[0].items():
        if isinstance(cost, str):
            lines.append(f"{name:>30}: {cost}")
            continue
        mark = "  above 20 um or 1 %" if cost.matters else ""
        lines.append(
            f"{name:>30}: {1e6 * cost.position:8.3g} um  {1e6 * cost.rotation:8.3g} "
            f"urad  {_energy_text(cost.energy)}{mark}"
            + (
                f"; below with {cost.pieces} pieces per beam"
                if mark and cost.pieces
                else ""
            )
        )
    return "\n".join([*lines, *_platform_lines(costs)])


def over_poses_text(costs: CostsOverPoses) -> str:
    """Format the median and largest error of each assumption as text."""
    count = len(costs.reached)
    lines = [
        f"{costs.robot.name}: errors due to the model's assumptions over {count} of "
        f"{len(costs.asked)} poses, median and largest"
    ]
    for name in costs.assumptions:
        row = _summary(costs, name)
        for reason, times in row["reasons"].items():
            where = "" if times == count else f" ({times} of {count})"
            lines.append(f"{name:>30}: {reason}{where}")
        if row["known"]:
            position, energy = row["position"], row["energy"]
            lines.append(
                f"{name:>30}: {1e6 * position['median']:8.3g} "
                f"{1e6 * position['largest']:8.3g} um  {100 * energy['median']:8.3g} "
                f"{_energy_text(energy['largest'])}; above 20 um or 1 % at "
                f"{row['matters']} of {row['known']}, most at "
                f"{pose_text(position['at'])}"
            )
    return "\n".join([*lines, *_platform_lines(costs)])


def _energy_text(share: float) -> str:
    """Format a relative energy difference."""
    if math.isnan(share):
        return "no energy is stored"
    return f"{100 * share:8.3g} % of the energy"


def _platform_lines(over: CostsOverPoses) -> list[str]:
    """Format the errors in platform compliance at one or many poses."""
    costs = over.platform
    if isinstance(costs, str):
        return [f"{'stiffness by solids':>30}: {costs}"]
    many = len(costs.beams) > 1
    lines = [
        "compliance of the platform, largest difference over all wrenches"
        + (": median and largest" if many else ":")
    ]
    rows = {text: getattr(costs, name) for name, text in COMPARED.items()}
    for name in list(costs.by_link)[:_NAMED]:
        rows[f"only {name} a beam"] = costs.by_link[name]
    for text, values in rows.items():
        row = spread(values, over.reached)
        middle = f"{100 * row['median']:8.3g} " if many else ""
        place = f" at {pose_text(row['at'])}" if many else ""
        lines.append(f"{text:>30}: {middle}{100 * row['largest']:8.3g} %{place}")
    lines.append(f"{'estimated mesh error':>30}: {100 * costs.mesh_error:8.3g} %")
    free = int(np.isnan(costs.beams).sum())
    if free:
        lines.append(f"not compared at {free} poses, where the platform moves freely")
    if costs.left:
        lines.append(
            f"links without a shape, stiffness as declared: {', '.join(costs.left)}"
        )
    return lines


def pose_text(asked: _Pose | None) -> str:
    """Format a pose, for example ``tx=0.1, tz=-0.5``, or ``-`` if there is none."""
    if asked is None:
        return "-"
    return ", ".join(f"{name}={value:.6g}" for name, value in asked.items())
