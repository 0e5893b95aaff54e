"""A callout with its zone and the errors that it causes, and the holes of callouts."""

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
    """A callout with its zone, and the errors of the frames that it causes.

    Attributes:
        callout: as the drawing states it.
        zone: of the feature, in its axes.
        errors: (n, 6, m) [rad, m] delta l of all frames for unit coordinates of the
            zone.
        datum: of which the zone is the shift at maximum material, or None.
    """

    callout: Callout
    zone: Zone
    errors: NDArray
    datum: Datum | None = None

    @property
    def words(self) -> str:
        """What is called out, or which datum shifts."""
        if self.datum is None:
            return self.callout.words
        return f"shift of datum {self.datum.hole_of}"

    @property
    def name(self) -> str:
        """Name in tables: ``"position of bore 2 on link_a"``."""
        return f"{self.words} of {self.callout.name}"

    @property
    def hole_of(self) -> str:
        """Name of the hole whose size decides how large the zone is, or empty."""
        return self.callout.hole_of if self.datum is None else self.datum.hole_of

    @property
    def hole(self) -> str:
        """Size of that hole, or empty."""
        return self.callout.hole if self.datum is None else self.datum.hole


def fault_of(callout: Callout, found: str) -> str:
    """Return the message on a callout."""
    return f"tolerance of {quoted(callout.name)}: {found}"


def fits_by_parts(robot: Robot) -> dict[str, str]:
    """Return the fits by the name of their parts: the frame, unless the file says."""
    ends = robot.fitted_ends
    return {ends[f].parts if f in ends else f: text for f, text in robot.fits.items()}


def check_holes(
    robot: Robot, placed: Sequence[PlacedCallout],
    body_of: Callable[[tuple[str, bool]], int],
) -> None:  # fmt: skip
    """Refuse holes at maximum material that one part cannot have.

    Args:
        robot: of the callouts.
        placed: its callouts and shifts of datums.
        body_of: number of the body of a side of a frame.

    Raises:
        BadInput: the same hole has two sizes, its fit has another one, or it is on two
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
            expected = f"{quoted(size)}, as before"
        elif fit is not None and _hole_of(fit) != parse_hole(one.hole):
            expected = f"that of the fit {quoted(fit)}"
        else:
            continue
        fault = f"found the hole {quoted(one.hole)}, expected {expected}"
        raise BadInput(fault_of(one.callout, fault))


def _hole_of(text: str) -> tuple[float, Limits]:
    """Nominal size and deviations of the hole of a fit."""
    fit = parse_fit(text)
    return fit.size, fit.hole
