"""Compute ISO 9283 and ISO 230-2 characteristics from the repeats of a campaign."""

import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from itertools import combinations, islice
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.inputs.errors import BadInput, quoted
from forcefit.results.text import in_unit, table_lines
from forcefit.validation.campaign.campaign import READING, Campaign, number_rows
from forcefit.validation.standards.iso230 import AxisFigures, axis_figures
from forcefit.validation.standards.iso9283 import (
    accuracy_drift,
    distance_accuracy,
    orientation_accuracy,
    orientation_repeatability,
    position_accuracy,
    position_repeatability,
)

_MOST_PAIRS = 2000  # largest number of evaluated pairs of positions


@dataclass(frozen=True)
class PoseFigures:
    """ISO 9283 characteristics of a pose for one load and direction of approach.

    Attributes:
        label: id of the first row of the table that contains the pose.
        cycles: number of cycles.
        accuracy: AP_P [m]; None if no positions were measured.
        repeatability: RP_l [m]; None if no positions were measured.
        angles: AP_a, AP_b, AP_c [rad]; None if no rotations were measured.
        angle_repeatability: RP_a, RP_b, RP_c [rad]; None if no rotations were measured.
        drift: drift of the accuracy AP_P [m]; None if it cannot be computed.
    """

    label: str
    cycles: int
    accuracy: float | None
    repeatability: float | None
    angles: tuple[float, ...] | None
    angle_repeatability: tuple[float, ...] | None
    drift: float | None


@dataclass(frozen=True)
class DistanceFigures:
    """ISO 9283 characteristics of the distance between two poses.

    Attributes:
        labels: ids of the first row of each pose.
        commanded: [m] commanded distance.
        accuracy: AD_P [m], with its sign.
        repeatability: RD [m].
    """

    labels: tuple[str, str]
    commanded: float
    accuracy: float
    repeatability: float


@dataclass(frozen=True)
class StandardFigures:
    """All characteristics of a campaign according to ISO 9283 and ISO 230-2.

    Attributes:
        campaign: name of the campaign.
        registration: ``"known"`` or ``"unknown"``.  If it is unknown, AP includes
            registration errors.
        poses: characteristics of the poses that were measured at least twice.
        distances: characteristics of pairs of poses with equal load, session, point and
            direction of approach.
        axes: mapping from name to the ISO 230-2 characteristics of a component that was
            approached from both directions.  Loads, sessions and points are evaluated
            separately, and the name contains the id of the first row.
    """

    campaign: str
    registration: str
    poses: tuple[PoseFigures, ...]
    distances: tuple[DistanceFigures, ...]
    axes: dict[str, AxisFigures]

    def table(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {
            "campaign": self.campaign,
            "registration": self.registration,
            "iso_9283": {
                "poses": [asdict(pose) for pose in self.poses],
                "distances": [asdict(pair) for pair in self.distances],
            },
            "iso_230_2": {name: asdict(axis) for name, axis in self.axes.items()},
        }

    def text(self) -> str:
        """Format as a table, followed by the worst value of each characteristic."""
        rows = {
            pose.label: [
                pose.cycles,
                *(math.nan if value is None else 1e6 * value
                  for value in (pose.accuracy, pose.repeatability, pose.drift)),
            ]
            for pose in self.poses
        }  # fmt: skip
        head = ("pose", "cycles", "AP [um]", "RP [um]", "drift [um]")
        lines = [f"{self.campaign}: ISO 9283, {len(rows)} poses with repeats",
                 *table_lines(head, rows, digits=4)]  # fmt: skip
        if self.registration == "unknown":
            lines.append("registration unknown: AP includes the position of the device")
        if self.distances:
            worst = max(self.distances, key=lambda pair: abs(pair.accuracy))
            a, b = worst.labels
            lines.append(
                f"distance accuracy, worst of {len(self.distances)}: "
                f"{in_unit(worst.accuracy, 'um')} of {worst.commanded:.4g} m, {a} to "
                f"{b}; repeatability {in_unit(worst.repeatability, 'um')}"
            )
        for name, axis in self.axes.items():
            unit = "urad" if name.startswith("r") else "um"
            lines.append(
                f"ISO 230-2 {name}: B {in_unit(axis.reversal, unit)}, "
                f"R {in_unit(axis.repeatability, unit)}, E "
                f"{in_unit(axis.systematic_deviation, unit)}, "
                f"A {in_unit(axis.accuracy, unit)}"
            )
        return "\n".join(lines)


def standard_figures(campaign: Campaign) -> StandardFigures:
    """Return the ISO 9283 and ISO 230-2 characteristics of a campaign.

    Args:
        campaign: campaign with rows measured more than once.

    Returns:
        The characteristics.  For ISO 9283, the two directions of approach are evaluated
        separately.

    Raises:
        BadInput: no row was measured more than once.
    """
    side = campaign.covariates.get("approach", np.ones(len(campaign)))
    group = number_rows(campaign.repeat, side)
    sets = [np.flatnonzero(group == k) for k in range(int(group.max()) + 1)]
    sets = [_in_time(campaign, rows) for rows in sets if len(rows) > 1]
    if not sets:
        raise BadInput(
            f"campaign {quoted(campaign.name)}: found no command that was measured "
            "twice; expected repeated measurements, which both standards require"
        )
    return StandardFigures(
        campaign.name,
        campaign.registration,
        tuple(_pose(campaign, rows) for rows in sets),
        tuple(_distances(campaign, sets)),
        dict(_axes(campaign)),
    )


def _in_time(campaign: Campaign, rows: NDArray) -> NDArray:
    """Return the rows in measuring order."""
    time = campaign.covariates.get("time")
    return rows if time is None else rows[np.argsort(time[rows], kind="stable")]


def _pose(campaign: Campaign, rows: NDArray) -> PoseFigures:
    """Return the ISO 9283 characteristics of the repeats of a pose."""
    turns, shifts = campaign.measured[rows, :3], campaign.measured[rows, 3:]
    turns, shifts = (d[np.isfinite(d).all(axis=1)] for d in (turns, shifts))
    placed, turned = len(shifts) > 1, len(turns) > 1
    return PoseFigures(
        label=campaign.ids[rows[0]],
        cycles=len(rows),
        accuracy=position_accuracy(shifts) if placed else None,
        repeatability=position_repeatability(shifts) if placed else None,
        angles=tuple(orientation_accuracy(turns).tolist()) if turned else None,
        angle_repeatability=(
            tuple(orientation_repeatability(turns).tolist()) if turned else None
        ),
        drift=accuracy_drift(shifts) if placed else None,
    )


def _circumstances(campaign: Campaign) -> NDArray:
    """Return labels (R,), equal for rows with the same load, session and point."""
    names = [
        np.unique(column, return_inverse=True)[1]
        for column in (campaign.session, campaign.point)
        if column is not None
    ]
    return number_rows(campaign.loads, *names)


def _distances(campaign: Campaign, sets: list[NDArray]) -> Iterator[DistanceFigures]:
    """Yield the ISO 9283 characteristics of the distances between poses.

    Only poses with the same load and session are compared, because another load would
    add a deflection, and another session a displacement of the device.

    Yields:
        The characteristics of each pair.
    """
    T = campaign.transforms[:, campaign.robot.index(campaign.robot.platform)]
    nominal = T[:, :3, 3] + np.einsum("rij,rj->ri", T[:, :3, :3], campaign.targets)
    attained = nominal + campaign.measured[:, 3:]
    side = campaign.covariates.get("approach", np.ones(len(campaign)))
    alike = number_rows(_circumstances(campaign), side)
    pairs = ((a, b) for a, b in combinations(sets, 2) if alike[a[0]] == alike[b[0]])
    for a, b in islice(pairs, _MOST_PAIRS):
        commanded = float(np.linalg.norm(nominal[a[0]] - nominal[b[0]]))
        count = min(len(a), len(b))
        first, second = attained[a[:count]], attained[b[:count]]
        read = np.isfinite(first + second).all(axis=1)
        if commanded > 0 and read.sum() > 1:
            ids = campaign.ids[a[0]], campaign.ids[b[0]]
            figures = distance_accuracy(first[read], second[read], commanded)
            yield DistanceFigures(ids, commanded, *figures)


def _axes(campaign: Campaign) -> Iterator[tuple[str, AxisFigures]]:
    """Yield the ISO 230-2 characteristics of each reading, load, session and point."""
    apart = _circumstances(campaign)
    for k, name in enumerate(READING):
        for number in range(int(apart.max()) + 1):
            rows = np.flatnonzero(apart == number)
            figures = _axis(campaign.take(rows), k)
            if figures is not None:
                alone = "" if apart.max() == 0 else f" from {campaign.ids[rows[0]]}"
                yield name + alone, figures


def _axis(campaign: Campaign, k: int) -> AxisFigures | None:
    """Return the characteristics of a component with repeats from both directions."""
    side, values = campaign.covariates.get("approach"), campaign.measured[:, k]
    if side is None:
        return None
    forward, backward = [], []
    for number in range(int(campaign.repeat.max()) + 1):
        rows = (campaign.repeat == number) & np.isfinite(values)
        up, down = values[rows & (side > 0)], values[rows & (side < 0)]
        if len(up) > 1 and len(down) > 1:
            forward.append(up)
            backward.append(down)
    return axis_figures(forward, backward) if forward else None
