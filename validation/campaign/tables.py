"""Convert results for the rows of a campaign to labelled arrays.

The arrays have the dimension ``row`` and the names of the columns in
``measurements.csv``.
"""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from forcefit.assembly.kinematics.nominal import mobile
from forcefit.assembly.model.tables import NO_LABELS, labelled
from forcefit.results.quantities import Quantity, count, number, text

if TYPE_CHECKING:
    import xarray

    from forcefit.validation.campaign.campaign import Campaign

_UNITS = {"temperature": "K", "time": "s", "approach": "1"}


def screw(words: str, meaning: str = "") -> Quantity:
    """Describe a quantity whose values are small displacements [rad, m]."""
    return Quantity(words, "rad, m", ("screw",), meaning)


def row_dataset(
    campaign: "Campaign",
    values: Mapping[str, Any],
    labels: Mapping[str, Sequence[Any]] = NO_LABELS,
) -> "xarray.Dataset":
    """Return a data set of arrays with one entry for each row of a campaign.

    Args:
        campaign: campaign of R rows.
        values: arrays as for :func:`forcefit.assembly.model.tables.labelled`. The first
            axis of every array has length R.
        labels: labels of additional dimensions.

    Returns:
        Data set with the dimension ``row``, labelled by the row ids.
    """
    data = labelled(values, "row", list(campaign.ids), labels)
    return data.assign_attrs(campaign=campaign.name, robot=campaign.robot.name)


def campaign_dataset(campaign: "Campaign") -> "xarray.Dataset":
    """Convert commands, loads, readings and covariates to a data set."""
    moves = mobile(campaign.robot)
    units = _UNITS | dict(campaign.motion_units)
    at_point = "at the reference point, base axes"
    values: dict[str, Any] = {
        "joint_coordinate": campaign.coordinates[:, moves],
        "load": campaign.loads,
        "reading": campaign.measured,
        "sigma": (screw("standard deviation of a reading", at_point), campaign.sigma),
        "configuration": (count("number of the configuration"), campaign.configuration),
        "repeat": (count("number of configuration and load"), campaign.repeat),
    }
    for name, column in {**campaign.covariates, **campaign.partial}.items():
        values[f"cov.{name}"] = number(name, units.get(name, "")), column
    for name in ("session", "point"):
        column = getattr(campaign, name)
        if column is not None:
            values[name] = text(name), column.astype(object)
    frames = zip(campaign.robot.frames, moves, strict=True)
    joints = [frame.name for frame, moving in frames if moving]
    return row_dataset(campaign, values, {"joint": joints})
