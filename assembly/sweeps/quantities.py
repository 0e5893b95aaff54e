"""The quantities of a sweep: those that may be requested, and their table."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from assembly.kinematics.singularity import KINDS
from assembly.model.link_stress import stressed_names
from assembly.model.robot import Robot
from assembly.sweeps.parameters import Design
from assembly.sweeps.point_stiffness import STATES, stiffness_parts
from forcefit.inputs.display import html_table, short_repr
from stiffness.screws import SCREW, WRENCH

if TYPE_CHECKING:
    from assembly.model.error_distributions import ErrorSources

TEXTS = ("reason", "near_singularity")


_READING = ("registration", "drift")  # effects that change readings, not screws


@dataclass(frozen=True, eq=False)
class Question:
    """The quantities requested at every point; sent to each worker once.

    robot: robot with its errors, which are used if none are drawn.
    design: its parameters, if some vary; otherwise None.
        design: its parameters, if some vary; else None.
        varied: paths of the varied parameters.
        components: components of the postures, see :mod:`assembly.sweeps.targets`.
        sources: sources of drawn errors; None for the robot's own.
        seed: seed of the draws.
        assumption: assumption of problem (27), or None to leave its bounds out.
        clearance_only: bound (27) also for the robot without errors.
        wrenches: frames whose wrench is recorded.
        linearisation: compare each point with finite motions.
        near: distance below which a singularity is named.
        strength: [Pa] yield strength of the links; stress and safety are then computed.
        load: (6,) [N m, N] on the platform at its origin, base axes.
        gravity: (3,) [m/s^2] base axes.
        under: covariates that the robot's effects depend on.
        stiffness: state of K_C, in :data:`assembly.sweeps.point_stiffness.STATES`, if
            K_C and the shares of its parts are computed too; otherwise empty.
        frequencies: number of natural frequencies, of the same K_C and declared masses.
        kept: names of the variables that are stored; all that are computed if empty.
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
        """Whether readings of a measuring device differ from the screw."""
        robot = self.robot
        effects = [robot.effects, *robot.session_effects.values()]
        return any(name in every for every in effects for name in _READING) or any(
            function.where == "reading" for function in robot.functions
        )


@dataclass(frozen=True)
class Variable:
    """One quantity of a data set.

    Attributes:
        dims: axes in addition to those of the points, with their labels.
        unit: unit of the numbers.
        meaning: text for ``long_name``.
    """

    dims: Mapping[str, tuple[str, ...]]
    unit: str
    meaning: str


def variables(question: Question) -> dict[str, Variable]:
    """Return the numeric quantities that a sweep stores, by name.

    Args:
        question: question of a sweep.

    Returns:
        All but ``status`` and the texts.
    """
    table = computed(question)
    return {k: v for k, v in table.items() if not question.kept or k in question.kept}


def computed(question: Question) -> dict[str, Variable]:
    """Return the numeric quantities that are computed; some may not be stored.

    Args:
        question: question of a sweep.

    Returns:
        All but ``status`` and the texts.
    """
    screw, bound = {"screw": SCREW}, {"bound": ("lower", "upper")}
    table = {
        "margin": Variable(
            {}, "1", "factor on all clearances at which it just assembles, compliant "
            "rigid",
        ),
        "margin_free": Variable(
            {}, "1", "the same, compliant joints free about their own axis"
        ),
        "energy": Variable({}, "J", "least elastic energy that closes it, eq. (22)"),
        "platform_screw": Variable(
            screw, "rad, m", "pose error at the platform's origin, base axes"
        ),
        "closure_residual": Variable(
            {}, "1", "largest closure error left, rad or reference lengths"
        ),
        "clearance_excess": Variable({}, "1", "by how much a clearance is exceeded"),
        "duality_gap": Variable({}, "J", "certified: energy is at most this too high"),
        "singular_distance": Variable(
            {"kind": KINDS}, "1", "0 at a singularity of the kind, at most 1"
        ),
        "condition": Variable({}, "1", "condition of the map from drives to platform"),
    }  # fmt: skip
    if question.reads_otherwise:
        table["reading"] = Variable(screw, "rad, m", "what a measuring device reads")
    for suffix, condition in _bound_suffixes(question):
        for part, unit in (("rotation", "rad"), ("translation", "m")):
            table[f"{part}_error{suffix}"] = Variable(
                bound, unit, f"certified bounds of the largest {part} error, eq. (27)"
                + condition,
            )  # fmt: skip
    if question.wrenches:
        table["wrench"] = Variable(
            {"frame": question.wrenches, "wrench_component": WRENCH}, "N m, N",
            "what the outer part exerts on the inner, at the frame in its axes",
        )  # fmt: skip
    if question.strength is not None:
        links = {"link": stressed_names(question.robot)}
        table["stress"] = Variable(links, "Pa", "largest von Mises stress in the link")
        table["stress_error"] = Variable(
            links, "1", "estimated relative error of the stress, by the mesh; a beam's "
            "formulas have 0, links with an inner edge without a fillet infinity",
        )  # fmt: skip
        table["safety"] = Variable({}, "1", "yield strength over the largest stress")
    if question.stiffness:
        table |= _stiffness_variables(question.robot, question.stiffness)
    if question.frequencies:
        modes = tuple(str(k + 1) for k in range(question.frequencies))
        table["frequency"] = Variable(
            {"mode": modes},
            "Hz",
            "natural, lowest first, drives held, without load and gravity",
        )
    if question.linearisation:
        for part, unit in (("rotation", "rad"), ("translation", "m")):
            table[f"linearisation_{part}"] = Variable(
                {}, unit, f"size of the platform's {part}, linear minus exact"
            )
        table["linearisation_energy"] = Variable(
            {}, "1", "energy, linear minus exact, relative to the exact one"
        )
    table["joint_coordinate"] = Variable(
        {"joint": _moving(question.robot)}, "rad or m",
        "nominal, of every joint, also where the status is not ok",
    )  # fmt: skip
    return table


def _moving(robot: Robot) -> tuple[str, ...]:
    """Return the names of the joints that are not fixed."""
    return tuple(f.name for f in robot.frames if f.joint != "fixed")


def _stiffness_variables(robot: Robot, state: str) -> dict[str, Variable]:
    """Return the variables of K_C."""
    along = {"wrench_component": WRENCH}
    return {
        "compliance": Variable(
            {"screw": SCREW, **along}, "rad/(N m) .. m/N",
            f"of the platform at its origin, base axes, {STATES[state]}",
        ),
        "stiffness": Variable(
            along, "N m/rad, N/m", "along each axis, the others free"
        ),
        "eigen_stiffness": Variable(
            {"eigen": tuple("123456")}, "N/m", "softest first, angles times the "
            "longest body",
        ),
        "stiffness_condition": Variable({}, "1", "stiffest over softest of them"),
        "share": Variable(
            {"part": stiffness_parts(robot, state), **along}, "1",
            "of every link and joint in the compliance along each axis",
        ),
    }  # fmt: skip


def _bound_suffixes(question: Question) -> Iterator[tuple[str, str]]:
    """Yield suffix and meaning of each pair of requested bounds."""
    if question.assumption is not None:
        yield "", f", {question.assumption}"
    if question.clearance_only:
        yield "_clearance", ", frozen, by clearances alone: without errors"


def record_type(question: Question) -> np.dtype:
    """Return type of a point's record: stored quantities, and ``status`` as a code."""
    return record_of(variables(question))


def record_of(table: Mapping[str, Variable]) -> np.dtype:
    """Return the type of a record of some quantities, and ``status`` as a code."""
    fields = [
        (name, "<f8", tuple(len(labels) for labels in v.dims.values()))
        for name, v in table.items()
    ]
    return np.dtype([*fields, ("status", "u1")])
