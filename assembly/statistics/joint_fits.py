"""Fits of joints, and the frames whose clearance they determine."""

from dataclasses import dataclass, replace

from forcefit.assembly.callouts.fits import Fit, FittedEnd, parse_fit
from forcefit.assembly.model.robot import Clearance, Frame, Robot
from forcefit.assembly.statistics.ranking import kind_of

# endings of frame names in universal, cylindrical and planar joints
_PARTS_OF_JOINTS = ("first", "second", "turn", "slide")


@dataclass(frozen=True, eq=False)
class JointFit:
    """A fit of a hole and a shaft in a joint.

    Attributes:
        frame: name of the frame of the joint, or names of the two fitted features.
        fit: the fit.
        bounds: index of each frame whose clearance the fit determines, with the fitted
            end; the end is None if the fit determines the key ``radial``.
    """

    frame: str
    fit: Fit
    bounds: tuple[tuple[int, FittedEnd | None], ...]

    @property
    def name(self) -> str:
        """Name in tables, such as ``"fit 12 H7/g6 of elbow"``."""
        return f"fit {self.fit.text} of {self.frame}"


def fits_of(robot: Robot) -> tuple[JointFit, ...]:
    """Return the fits of a robot, one for each pair of hole and shaft."""
    found: dict[str, JointFit] = {}
    for frame, text in robot.fits.items():
        end = robot.fitted_ends.get(frame)
        name = frame if end is None else end.parts
        one = found.get(name, JointFit(name, parse_fit(text), ()))
        bound = robot.index(frame), end
        found[name] = replace(one, bounds=(*one.bounds, bound))
    return tuple(found.values())


def kind_of_fit(robot: Robot, fit: JointFit) -> str:
    """Return the name of a fit without the name of the leg."""
    joint, _, rest = fit.frame.partition(".")
    frames = {frame.name for frame in robot.frames}
    of_joint = joint in frames or rest.split(".")[0] in _PARTS_OF_JOINTS
    return fit.frame if of_joint else kind_of(fit.frame)


def with_clearance(frame: Frame, new: dict[str, float]) -> Frame:
    """Return the frame with a new clearance, for a bolted joint before bolting."""
    bolt = frame.locked_at
    if bolt is not None:
        clearance = replace(bolt.clearance, **new)
        return replace(frame, locked_at=replace(bolt, clearance=clearance))
    return replace(frame, clearance=replace(frame.clearance or Clearance(), **new))
