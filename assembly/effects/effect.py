"""An effect: a property that a declared model lacks, as a change of conditions."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from forcefit.assembly.measurement.conditions import Conditions
from forcefit.assembly.model.robot import Robot

Values = Mapping[str, float]
RIGID = 1e-12  # [rad/(N m), m/N] fitted compliance below which a part counts as rigid


@dataclass(frozen=True)
class Unknown:
    """An unknown of the fit, chosen so that the model is nearly linear in it.

    Attributes:
        name: name of a parameter, or of a part of a parameter.  For an effect that acts
            at frames, the name is appended to the frame's name (``""`` if the frame's
            name is sufficient).
        scale: plausible absolute value, in the unit of the parameter or of its part.
        lower: smallest value that is physically possible.
        upper: largest value that is physically possible.
        start: value that means no effect, at which the first derivative is computed.
        scan: start values of the search, if the model is strongly nonlinear.
        scan_by: name of a covariate whose range multiplies ``scan``, if any.
    """

    name: str
    scale: float
    lower: float = float("-inf")
    upper: float = float("inf")
    start: float = 0.0
    scan: tuple[float, ...] = ()
    scan_by: str = ""


def _as_they_are(robot: Robot, values: Values) -> dict[str, float]:
    """Return the unknowns unchanged, because they are equal to the parameters."""
    return dict(values)


@dataclass(frozen=True)
class Effect:
    """One effect of the library.

    Attributes:
        name: name of the effect in the public format.
        apply: function that adds the effect to conditions.  Its arguments are the
            conditions without the effect and the effect's parameters by public name
            (``<frame>``, ``<frame>.<component>`` or plain).
        unit: function from the robot and a parameter's public name to the parameter's
            unit.
        frames: function from a robot to the frames at which the effect can act; None if
            the effect does not act at frames.
        device_alone: whether the effect is an error of the measuring device.  If a
            function of the robot has the same influence on the readings, that function
            is more probable.
        refines: name of the effect that is a limiting case of this one; ``""`` for
            none.
        tried: function from a robot to the frames at which a diagnosis searches the
            effect; None for all frames at which it can act.
        components: public parameters at each frame (``""`` for the frame's name
            itself), or of the effect as a whole.
        unknowns: unknowns of the fit, at each frame or for the effect as a whole.
        public: function from unknowns by name (a frame's name, a dot, the unknown's
            name) to parameters by public name.
        needs: covariates that are required to apply or identify the effect.
        linear: whether the platform's deviation is linear in the unknowns, to first
            order in all small motions.
        by_row: whether the effect changes individual measurements (rows).  Such an
            effect can act in only one session.  Otherwise the effect changes the robot.
        finite: whether the effect requires finite motions.
        clearance: whether the effect adds clearance to joints.
        device: unknowns that move the measuring frame as a whole.
        splits: whether each unknown of the effect can act without the others.
        follows_load: whether the unknowns ``offset.<c>`` correspond to the load
            components that a campaign records.
        weighs: whether the effect acts only through gravity.
    """

    name: str
    apply: Callable[[Conditions, Values], Conditions]
    unit: Callable[[Robot, str], str]
    frames: Callable[[Robot], tuple[str, ...]] | None
    components: tuple[str, ...]
    unknowns: Callable[[Robot], tuple[Unknown, ...]]
    public: Callable[[Robot, Values], dict[str, float]] = _as_they_are
    needs: tuple[str, ...] = ()
    linear: bool = True
    by_row: bool = False
    finite: bool = False
    clearance: bool = False
    device: tuple[str, ...] = ()
    splits: bool = False
    follows_load: bool = False
    weighs: bool = False
    refines: str = ""
    device_alone: bool = False
    tried: Callable[[Robot], tuple[str, ...]] | None = None


def at(frame: str, kind: str) -> str:
    """Return the name of an unknown or a parameter of a frame."""
    return f"{frame}.{kind}" if kind else frame
