"""Quantities of sweeps, with units and descriptions."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from forcefit.assembly.effects import apply_known
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.kinematics.singularity import KINDS
from forcefit.assembly.measurement.conditions import as_declared
from forcefit.assembly.model.joint_names import shown_name
from forcefit.assembly.model.link_stress import stressed_names
from forcefit.assembly.model.robot import Robot
from forcefit.assembly.platform_stiffness.matrices import Part
from forcefit.assembly.sweeps.parameters import Design
from forcefit.assembly.sweeps.point_stiffness import STATES, stiffness_parts
from forcefit.results.display import html_table, short_repr
from forcefit.results.quantities import LABELS, QUANTITIES, Quantity

if TYPE_CHECKING:
    from forcefit.assembly.model.error_distributions import ErrorSources

TEXTS = ("reason", "near_singularity")
ERRORS = ("rotation_error", "translation_error")
BY_CLEARANCE = ("rotation_error_clearance", "translation_error_clearance")
FINITE = ("linearisation_rotation", "linearisation_translation", "linearisation_energy")
STRESS = ("stress", "stress_error", "safety")

# effects that change the measured pose, but not the platform screw
_READING = ("registration", "drift")


@dataclass(frozen=True, eq=False)
class Question:
    """The quantities to compute at every point of a sweep.

    Attributes:
        robot: robot. Its errors are used if ``sources`` is None.
        design: content of the robot file; None if no parameters are varied.
        varied: paths of the varied parameters.
        components: components of the postures, see
            :mod:`forcefit.assembly.sweeps.targets`.
        sources: distributions of random errors, or None.
        seed: seed of the random errors.
        assumption: assumption of problem (27); None to omit pose error bounds.
        clearance_only: whether pose error bounds without geometric errors are computed.
        wrenches: frames whose wrenches are stored.
        linearisation: whether the exact solution is computed for comparison.
        near: distance below which a nearby singularity is reported.
        strength: [Pa] yield strength of the links; None to omit stress and safety.
        load: (6,) [N m, N] load on the platform at its origin in base axes.
        gravity: (3,) [m/s^2] gravity in base axes.
        under: covariates of the robot's effects.
        stiffness: state in which K_C is computed, one of
            :data:`forcefit.assembly.sweeps.point_stiffness.STATES`; empty to omit it.
        frequencies: number of natural frequencies.
        kept: names of the variables to store; empty to store all.
    """

    robot: Robot
    design: Design | None = None
    varied: tuple[str, ...] = ()
    components: tuple[str, ...] = ()
    sources: "ErrorSources | None" = None
    seed: int = 0
    assumption: str | None = None
    clearance_only: bool = False
    wrenches: tuple[str, ...] = ()
    linearisation: bool = False
    near: float = 0.02
    strength: float | None = None
    load: tuple[float, ...] = (0.0,) * 6
    gravity: tuple[float, ...] = (0.0,) * 3
    under: Mapping[str, float | str] = field(default_factory=dict)
    stiffness: str = ""
    frequencies: int = 0
    kept: tuple[str, ...] = ()

    __repr__, _repr_html_ = short_repr, html_table

    @property
    def reads_otherwise(self) -> bool:
        """Whether an effect changes the measured pose, but not the platform screw."""
        robot = self.robot
        effects = [robot.effects, *robot.session_effects.values()]
        return any(name in every for every in effects for name in _READING) or any(
            function.where == "reading" for function in robot.functions
        )


@dataclass(frozen=True)
class Variable:
    """A variable of a sweep's data set.

    Attributes:
        dims: labels of each additional axis, by name of the axis.
        quantity: unit and description of the quantity.
        condition: text on the conditions of the computation.
    """

    dims: Mapping[str, tuple[str, ...]]
    quantity: Quantity
    condition: str = ""

    @property
    def attributes(self) -> dict[str, str]:
        """Attributes of the NetCDF variable."""
        known = self.quantity.attributes
        return known | {"long_name": known["long_name"] + self.condition}


def _variable(name: str, condition: str = "", **labels: tuple[str, ...]) -> Variable:
    """Return a variable with the given labels of its axes."""
    known = QUANTITIES[name]
    every = {**LABELS, **labels}
    dims = {dim: every[dim] for dim in (*labels, *known.dims)}
    return Variable(dims, known, condition)


def variables(question: Question) -> dict[str, Variable]:
    """Return the numeric variables that are stored, by name.

    Args:
        question: quantities of a sweep.

    Returns:
        All variables except ``status`` and the texts.
    """
    table = computed(question)
    return {k: v for k, v in table.items() if not question.kept or k in question.kept}


def computed(question: Question) -> dict[str, Variable]:
    """Return the numeric variables that are computed, by name.

    Args:
        question: quantities of a sweep.

    Returns:
        All variables except ``status`` and the texts.
    """
    names = [
        "margin", "margin_free", "energy", "platform_screw", "closure_residual",
        "clearance_excess", "duality_gap",
    ]  # fmt: skip
    table = {name: _variable(name) for name in names} | {
        "singular_distance": _variable("singular_distance", kind=KINDS),
        "condition": _variable("condition"),
    }
    if question.reads_otherwise:
        table["reading"] = _variable("reading")
    if question.assumption is not None:
        condition = f", {question.assumption}"
        table |= {name: _variable(name, condition) for name in ERRORS}
    if question.clearance_only:
        table |= {name: _variable(name) for name in BY_CLEARANCE}
    if question.wrenches:
        table["wrench"] = _variable("wrench", frame=question.wrenches)
    if question.strength is not None:
        links = stressed_names(question.robot)
        table |= {name: _variable(name, link=links) for name in STRESS[:2]}
        table["safety"] = _variable("safety")
    if question.stiffness:
        table |= _stiffness_variables(question)
    if question.frequencies:
        modes = tuple(str(k + 1) for k in range(question.frequencies))
        table["frequency"] = _variable("frequency", mode=modes)
    if question.linearisation:
        table |= {name: _variable(name) for name in FINITE}
    joints = _moving(question.robot)
    return table | {"joint_coordinate": _variable("joint_coordinate", joint=joints)}


def _moving(robot: Robot) -> tuple[str, ...]:
    """Return the names of all joints that are not fixed."""
    return tuple(f.name for f in robot.frames if f.joint != "fixed")


def _stiffness_variables(question: Question) -> dict[str, Variable]:
    """Return the variables for the platform stiffness."""
    eigen, state = tuple("123456"), question.stiffness
    return {
        "compliance": _variable("compliance", f", at its origin, {STATES[state]}"),
        "stiffness": _variable("axis_stiffness"),
        "eigen_stiffness": _variable("eigen_stiffness", eigen=eigen),
        "stiffness_condition": _variable("stiffness_condition"),
        "share": _variable("share", part=_share_parts(question)),
    }


@lru_cache(maxsize=4)
def _share_parts(question: Question) -> tuple[str, ...]:
    """Return the contributions to the compliance, including those of effects.

    Effects add springs, for example of a drive or the foundation.  A varied number may
    add a clearance to a frame that has none in the robot file.
    """
    robot = question.robot
    if robot.has_effects:
        home = home_posture(robot.without_effects())
        declared = as_declared(home, question.load, covariates=question.under)
        robot = apply_known(declared, robot).robot
    parts = list(stiffness_parts(robot, question.stiffness))
    if question.stiffness == "contact" and question.design is not None:
        varied = [path.split(".clearance.")[0] for path in question.varied
                  if ".clearance." in path]  # fmt: skip
        names = [f.name for f in robot.frames]
        for row, name in enumerate(names):
            if name in varied or name.partition(".")[2] in varied:
                parts.append(Part(shown_name(robot, row), "clearance").words)
    return tuple(dict.fromkeys(parts))


def record_type(question: Question) -> np.dtype:
    """Return the type of a record with the stored variables and the status."""
    return record_of(variables(question))


def record_of(table: Mapping[str, Variable]) -> np.dtype:
    """Return the type of a record with given variables and the status."""
    fields = [
        (name, "<f8", tuple(len(labels) for labels in v.dims.values()))
        for name, v in table.items()
    ]
    return np.dtype([*fields, ("status", "u1")])
