"""Tolerance callouts with the resulting frame errors, and checks of holes."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from numpy.typing import NDArray

from forcefit.assembly.callouts.callout import Callout, Datum
from forcefit.assembly.callouts.fits import Limits, parse_fit, parse_hole
from forcefit.assembly.callouts.zone import Zone
from forcefit.assembly.model.robot import Robot
from forcefit.inputs.table import BadInput, quoted


@dataclass(frozen=True, eq=False)
class PlacedCallout:
    """A tolerance callout with its zone and the resulting frame errors.

    Attributes:
        callout: tolerance callout.
        zone: tolerance zone of the feature, in the feature's axes.
        errors: (n, 6, m) [rad, m] delta l of n frames per unit of the m zone
            coordinates.
        datum: datum at maximum material if the zone describes the shift of this datum,
            otherwise None.
    """

    callout: Callout
    zone: Zone
    errors: NDArray
    datum: Datum | None = None

    @property
    def words(self) -> str:
        """Text about the toleranced characteristic, or about the shifted datum."""
        if self.datum is None:
            return self.callout.words
        return f"shift of datum {self.datum.hole_of}"

    @property
    def name(self) -> str:
        """Printed name, such as ``"position of bore 2 on link_a"``."""
        return f"{self.words} of {self.callout.name}"

    @property
    def hole_of(self) -> str:
        """Name of the hole whose actual size changes the width of the zone, or ""."""
        return self.callout.hole_of if self.datum is None else self.datum.hole_of

    @property
    def hole(self) -> str:
        """Nominal size and tolerance of the hole, such as ``"12 H7"``, or ""."""
        return self.callout.hole if self.datum is None else self.datum.hole


def fault_of(callout: Callout, found: str) -> str:
    """Return an error message about the feature of a callout."""
    return f"tolerance of {quoted(callout.name)}: {found}"


def fits_by_parts(robot: Robot) -> dict[str, str]:
    """Return the fits by part name, or by frame name for fits without part name."""
    ends = robot.fitted_ends
    return {ends[f].parts if f in ends else f: text for f, text in robot.fits.items()}


def check_holes(
    robot: Robot, placed: Sequence[PlacedCallout],
    body_of: Callable[[tuple[str, bool]], int],
) -> None:  # fmt: skip
    """Check that data of holes with the maximum material condition are consistent.

    Args:
        robot: robot to which the callouts belong.
        placed: callouts of the robot, and shifts of its datums.
        body_of: function that returns the index of the body before or after a joint.

    Raises:
        BadInput: a hole has two sizes, differs in size from its fit, or belongs to two
            bodies.
    """
    fits, seen = fits_by_parts(robot), dict[str, tuple[str, int]]()
    for one in placed:
        if not one.hole:
            continue
        body = body_of((one.callout.feature, one.callout.after))
        size, first = seen.setdefault(one.hole_of, (one.hole, body))
        if body != first:
            fault = f"found the hole of {quoted(one.hole_of)} on two bodies"
            raise BadInput(fault_of(one.callout, f"{fault}, expected one hole"))
        fit = fits.get(one.hole_of)
        if parse_hole(size) != parse_hole(one.hole):
            expected = f"{quoted(size)}, as stated before"
        elif fit is not None and _hole_of(fit) != parse_hole(one.hole):
            expected = f"that of the fit {quoted(fit)}"
        else:
            continue
        fault = f"found the hole {quoted(one.hole)}, expected {expected}"
        raise BadInput(fault_of(one.callout, fault))


def _hole_of(text: str) -> tuple[float, Limits]:
    """Return the nominal size and the deviations of the hole of a fit."""
    fit = parse_fit(text)
    return fit.size, fit.hole
