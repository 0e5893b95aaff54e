"""Definition of an effect, which modifies the conditions of measurements."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from forcefit.assembly.measurement.conditions import Conditions
from forcefit.assembly.model.robot import Robot

Values = Mapping[str, float]
RIGID = 1e-12  # [rad/(N m), m/N] compliance below which a fitted spring is rigid


@dataclass(frozen=True)
class Unknown:
    """Quantity that a fit determines, chosen so that the model is nearly linear in it.

    Attributes:
        name: name of the parameter, or of a component of the parameter.  For an effect
            at frames, the name is appended to the frame name.
        scale: typical magnitude, in the unit of the parameter.
        lower: smallest physically possible value.
        upper: largest physically possible value.
        start: value at which the effect vanishes, and at which derivatives are first
            evaluated.
        scan: initial guesses, if the model is strongly nonlinear.
        scan_by: name of the covariate by whose range ``scan`` is multiplied, or "".
    """

    name: str
    scale: float
    lower: float = float("-inf")
    upper: float = float("inf")
    start: float = 0.0
    scan: tuple[float, ...] = ()
    scan_by: str = ""


def _as_they_are(robot: Robot, values: Values) -> dict[str, float]:
    """Return the fitted values as parameters without conversion."""
    return dict(values)


@dataclass(frozen=True)
class Effect:
    """One effect of the library.

    Attributes:
        name: name of the effect in the public format.
        apply: function that adds the effect to conditions.  Its arguments are the
            conditions and the parameters of the effect by public name.
        unit: function that returns the unit of a parameter, given the robot and its
            public name.
        frames: function that returns the frames of a robot at which the effect can act;
            None if the effect does not act at frames.
        device_alone: whether the effect is only an error of the measuring device.
        refines: name of an effect that is a limiting case of this effect, or "".
        tried: function that returns the frames at which a diagnosis searches for the
            effect; None if they are those of ``frames``.
        components: names of the parameters at each frame, or of the complete effect.
            ``""`` denotes a parameter with the name of the frame.
        unknowns: quantities that a fit determines, at each frame or for the complete
            effect.
        public: function that converts unknowns (keys ``<frame>.<unknown>``) to
            parameters by public name.
        needs: covariates required to apply or identify the effect.
        linear: whether the platform deviation is linear in the unknowns for small
            motions.
        by_row: whether the effect can differ between measurements, and therefore be
            limited to a session.
        finite: whether the effect requires finite motions.
        clearance: whether the effect adds clearance to joints.
        device: names of unknowns that displace the measuring frame.
        splits: whether each unknown can be fitted without the others.
        follows_load: whether the unknowns ``offset.<c>`` correspond to recorded load
            components.
        weighs: whether the effect requires gravity.
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
    """Return the name of an unknown or a parameter at a frame."""
    return f"{frame}.{kind}" if kind else frame
