"""Write remarks about effects that cannot be detected with a campaign."""

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from forcefit.inputs.table import quoted
from forcefit.validation.campaign.campaign import LOAD, READING, Campaign
from forcefit.validation.campaign.checks import extent_of
from forcefit.validation.inspection.counts import correlation
from forcefit.validation.inspection.measuring_order import Revisits
from forcefit.validation.inspection.remark import CAREFUL, FINE, LOST, Remark
from forcefit.validation.inspection.repeat_remarks import on_repeats
from forcefit.validation.inspection.repeats import RepeatNoise

# [1/K] Thermal expansion coefficient of aluminium.
_EXPANSION = 2.4e-5
# Correlation above which the effects of two covariates cannot be distinguished.
_TOGETHER = 0.9
# Largest plausible manufacturing error, relative to the size of the robot.
_UNIT = 0.02


def remarks_on(
    campaign: Campaign, repeats: Revisits, visits: Revisits, noise: RepeatNoise | None
) -> list[Remark]:
    """Return all remarks about a campaign, most serious first.

    Args:
        campaign: campaign of R rows.
        repeats: measuring order of the repeats.
        visits: measuring order of the configurations.
        noise: noise computed from the repeats, None without repeats.
    """
    remarks = [
        *_on_readings(campaign), *_on_configurations(campaign, visits),
        *_on_loads(campaign), *_on_temperature(campaign), *_on_approach(campaign),
        *_on_time(campaign), *_on_covariates(campaign),
        *on_repeats(campaign, repeats, noise),
    ]  # fmt: skip
    return sorted(remarks, key=lambda r: (LOST, CAREFUL, FINE).index(r.weight))


def _on_readings(campaign: Campaign) -> list[Remark]:
    """Return remarks about missing, constant, rounded and implausible readings."""
    remarks = []
    measured, sigma = campaign.measured, campaign.sigma
    absent = ", ".join(campaign.not_measured)
    if absent:
        text = (
            f"Components never measured: {absent}. Effects that change only these "
            "components cannot be detected."
        )
        remarks.append(Remark("readings", LOST, text))
    for k, name in enumerate(READING):
        column = measured[campaign.cells[:, k], k]
        if len(column) < 3 or np.isnan(sigma[campaign.cells[:, k], k]).all():
            continue
        values = np.unique(column)
        typical = float(np.median(sigma[campaign.cells[:, k], k]))
        if len(values) == 1:
            text = f"{name} is the same in every row. Is the device connected?"
            remarks.append(Remark("readings", CAREFUL, text))
        elif len(values) < len(column) / 2 and np.diff(values).min() > 2 * typical:
            step = np.diff(values).min()
            text = f"{name} is rounded to {step:.2g}, more than twice its sigma " \
                   f"{typical:.2g}. The noise is mainly due to rounding."  # fmt: skip
            remarks.append(Remark("readings", CAREFUL, text))
    extent = extent_of(campaign.transforms, np.zeros((1, 3)))
    largest = np.nanmax(np.abs(measured[:, 3:]), initial=0.0)
    if campaign.registration == "known" and largest > _UNIT * extent:
        text = (
            f"The largest deviation is {largest:.3g} m, and the size of the robot is "
            f'{extent:.3g} m. Is the unit m, and is the registration "known"?'
        )
        remarks.append(Remark("readings", CAREFUL, text))
    return remarks


def _on_configurations(campaign: Campaign, visits: Revisits) -> list[Remark]:
    """Return remarks about joints that never move, and about the measuring order."""
    remarks = []
    robot = campaign.robot
    still = [
        f.name
        for i, f in enumerate(robot.frames)
        if f.actuated and np.ptp(campaign.coordinates[:, i]) < 1e-9
    ]
    count = len(np.unique(campaign.configuration))
    if count == 1:
        text = (
            "There is only one configuration, so geometric errors, offsets and a wrong "
            "registration cannot be distinguished."
        )
        remarks.append(Remark("configurations", LOST, text))
    elif still:
        text = f"Drives that never moved: {', '.join(quoted(s) for s in still[:6])}. " \
               "Their offsets cannot be distinguished from wrong lengths or " \
               "angles."  # fmt: skip
        remarks.append(Remark("configurations", LOST, text))
    if visits.order == "back to back" and count > 1:
        text = (
            "All rows of each configuration were measured consecutively, so changes "
            "with time cannot be distinguished from effects of the configuration."
        )
        remarks.append(Remark("configurations", LOST, text))
    return remarks


def _on_loads(campaign: Campaign) -> list[Remark]:
    """Return remarks about the magnitudes and directions of the load."""
    loads = campaign.loads
    if not loads.any():
        text = (
            "No load was applied. Compliance and clearances can be detected only by "
            "the effect of weight and internal forces. Load errors cannot be detected."
        )
        return [Remark("load", LOST, text)]
    remarks = []
    both = np.column_stack([campaign.configuration, campaign.repeat])
    kinds = np.unique(both, axis=0)[:, 0]
    twice = int((np.bincount(kinds) > 1).sum())
    if len(np.unique(loads.round(9), axis=0)) == 1:
        text = (
            "All rows have the same load. Its effect cannot be distinguished from "
            "errors without load, and stiffening cannot be distinguished from linear "
            "compliance."
        )
        remarks.append(Remark("load", LOST, text))
    elif twice == 0:
        text = (
            "No configuration was measured under two loads, so only the model "
            "distinguishes effects of the load from effects of the configuration."
        )
        remarks.append(Remark("load", CAREFUL, text))
    else:
        rank = np.linalg.matrix_rank(loads[:, 3:], 1e-6 * np.abs(loads).max())
        if rank == 1:
            text = (
                "All forces have the same direction, so only compliance in this "
                "direction can be detected."
            )
            remarks.append(Remark("load", CAREFUL, text))
        else:
            text = f"{twice} configurations were measured under more than one load."
            remarks.append(Remark("load", FINE, text))
    return remarks


def _on_temperature(campaign: Campaign) -> list[Remark]:
    """Return remarks on whether thermal expansion can be detected."""
    temperature = campaign.covariates.get("temperature")
    if temperature is None:
        text = (
            "The campaign has no cov.temperature, so thermal expansion can be neither "
            "detected nor excluded."
        )
        return [Remark("temperature", LOST, text)]
    span = float(np.ptp(temperature))
    if span == 0.0:
        value = float(temperature[0])
        what = (
            "thermal expansion has the same effect as longer links"
            if value
            else "thermal expansion has no effect"
        )
        text = f"The temperature is {value:+.3g} K in every row, so {what}."
        return [Remark("temperature", LOST, text)]
    extent = extent_of(campaign.transforms, np.zeros((1, 3)))
    most = _EXPANSION * span * extent
    sigma = campaign.sigma[:, 3:][campaign.cells[:, 3:]]
    if sigma.size and most < np.median(sigma):
        text = (
            f"The temperature varied by {span:.2g} K. Thermal expansion of aluminium "
            f"would move the platform by at most {most:.2g} m, less than one sigma."
        )
        return [Remark("temperature", CAREFUL, text)]
    text = f"The temperature varied by {span:.2g} K."
    return [Remark("temperature", FINE, text)]


def _on_approach(campaign: Campaign) -> list[Remark]:
    """Return remarks on whether friction can be detected."""
    side = campaign.covariates.get("approach")
    if side is None:
        text = (
            "The campaign has no cov.approach, so friction can be neither detected nor "
            "excluded."
        )
        return [Remark("approach", LOST, text)]
    if np.ptp(side) == 0.0:
        text = (
            "All rows were approached from the same side, so friction has the same "
            "effect as an offset."
        )
        return [Remark("approach", LOST, text)]
    both = _in_both(campaign.configuration, side)
    if not both:
        text = (
            "No configuration was approached from both sides, so only the model "
            "distinguishes friction from effects of the configuration."
        )
        return [Remark("approach", CAREFUL, text)]
    return [
        Remark(
            "approach", FINE, f"{both} configurations were approached from both sides."
        )
    ]


def _on_time(campaign: Campaign) -> list[Remark]:
    """Return remarks on whether a drift can be detected."""
    if np.ptp(campaign.covariates.get("time", np.zeros(1))) == 0.0:
        text = (
            "The campaign has no cov.time, or its value is the same in every row. A "
            "drift can be neither detected nor excluded. Rows are assumed to be in the "
            "order of measurement."
        )
        return [Remark("time", LOST, text)]
    return []


def _on_covariates(campaign: Campaign) -> list[Remark]:
    """Return remarks about correlated covariates."""
    columns = dict(campaign.covariates)
    for name, values in zip(LOAD, campaign.loads.T, strict=True):
        columns[f"load.{name}"] = values
    remarks = []
    for (a, x), (b, y) in combinations(columns.items(), 2):
        together = correlation(x, y)
        if abs(together) > _TOGETHER:
            text = (
                f"{a} and {b} vary together (correlation {together:+.2f}), so their "
                "effects are difficult to distinguish."
            )
            remarks.append(Remark("covariates", CAREFUL, text))
    return remarks


def _in_both(configuration: NDArray, side: NDArray) -> int:
    """Return the number of configurations approached from both directions."""
    return len(np.intersect1d(configuration[side > 0], configuration[side < 0]))
