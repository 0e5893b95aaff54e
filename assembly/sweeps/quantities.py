"""What a sweep may ask at its points, and the table of numbers that it gets."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from assembly.linear.singularity import KINDS
from assembly.model.link_stress import stressed_names
from assembly.model.robot import Robot
from assembly.sweeps.parameters import Design
from forcefit.inputs.display import html_table, short_repr
from stiffness.screws import SCREW, WRENCH

if TYPE_CHECKING:
    from assembly.model.error_distributions import ErrorSources

STATUSES = (
    "ok", "out of reach", "cannot assemble", "solver failed", "invalid robot",
    "no equilibrium",
)  # fmt: skip
TEXTS = ("reason", "near_singularity")


@dataclass(frozen=True, eq=False)
class Question:
    """What is asked at every point; workers are sent this once.

    Attributes:
        robot: with its errors, which stand where none are drawn.
        design: the numbers it is written in, if some vary; else None.
        varied: paths of the numbers that vary.
        components: of the postures, see :mod:`assembly.sweeps.targets`.
        sources: of drawn errors; None for the robot's own.
        seed: of the draws.
        reading: of problem (27), or None to leave its bounds out.
        play_alone: bound (27) also for the robot without errors: by play alone.
        wrenches: frames whose wrench is kept.
        linearisation: compare each point with finite motions.
        near: distance below which a singularity is named.
        strength: [Pa] yield strength of the links; stress and safety are then found.
        load: (6,) [N m, N] on the platform at its origin, base axes.
        gravity: (3,) [m/s^2] base axes.
        under: covariates that the robot's effects depend on.
    """

    robot: Robot
    design: Design | None = None
    varied: tuple[str, ...] = ()
    components: tuple[str, ...] = ()
    sources: "ErrorSources | None" = None
    seed: int = 0
    reading: str | None = None
    play_alone: bool = False
    wrenches: tuple[str, ...] = ()
    linearisation: bool = False
    near: float = 0.02
    strength: float | None = None
    load: tuple[float, ...] = (0.0,) * 6
    gravity: tuple[float, ...] = (0.0,) * 3
    under: Mapping[str, float | str] = field(default_factory=dict)

    __repr__, _repr_html_ = short_repr, html_table

    @property
    def reads_otherwise(self) -> bool:
        """Whether a measuring device reads something else than the platform's screw."""
        return any(name in self.robot.effects for name in ("registration", "drift"))


@dataclass(frozen=True)
class Variable:
    """One quantity of a data set.

    Attributes:
        dims: axes beside those of the points, with their labels.
        unit: of its numbers.
        meaning: for ``long_name``.
    """

    dims: Mapping[str, tuple[str, ...]]
    unit: str
    meaning: str


def variables(question: Question) -> dict[str, Variable]:
    """The numeric quantities that a question asks for, by name.

    Args:
        question: of a sweep.

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
    for suffix, said in _bound_suffixes(question):
        for part, unit in (("rotation", "rad"), ("translation", "m")):
            table[f"{part}_error{suffix}"] = Variable(
                bound, unit, f"certified bounds of the largest {part} error, eq. (27)"
                + said,
            )  # fmt: skip
    if question.wrenches:
        table["wrench"] = Variable(
            {"frame": question.wrenches, "wrench_component": WRENCH}, "N m, N",
            "what the outer part exerts on the inner, at the frame in its axes",
        )  # fmt: skip
    if question.strength is not None:
        links = {"link": stressed_names(question.robot)}
        table["stress"] = Variable(links, "Pa", "largest von Mises stress in the link")
        table["safety"] = Variable({}, "1", "yield strength over the largest stress")
    if question.linearisation:
        for part, unit in (("rotation", "rad"), ("translation", "m")):
            table[f"linearisation_{part}"] = Variable(
                {}, unit, f"size of the platform's {part}, linear minus exact"
            )
        table["linearisation_energy"] = Variable(
            {}, "1", "energy, linear minus exact, relative to the exact one"
        )
    return table


def _bound_suffixes(question: Question) -> Iterator[tuple[str, str]]:
    """Suffix and meaning of each pair of bounds asked for."""
    if question.reading is not None:
        yield "", f", {question.reading}"
    if question.play_alone:
        yield "_play", ", frozen, by play alone: without errors"


def record_type(question: Question) -> np.dtype:
    """A point as a row of numbers: its quantities, and ``status`` as a code."""
    fields = [
        (name, "<f8", tuple(len(labels) for labels in v.dims.values()))
        for name, v in variables(question).items()
    ]
    return np.dtype([*fields, ("status", "u1")])
