"""Steps of an assembly plan.

The screw of a frame refers to the origin and the axes of the frame.  The opening of a
closure refers to the origin and the axes of its first frame.  In a robot file of format
2, it refers to the point and the axes of the joint.  Components are named ``RX RY RZ TX
TY TZ``.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.model.robot import Robot
from forcefit.inputs.table import BadInput, quoted
from forcefit.stiffness.screws import SCREW

Closure = tuple[str, str]
GRAVITY = "gravity"  # name of the weights in the dictionary of loads


@dataclass(frozen=True)
class Fix:
    """A step in which a fixture holds a frame in position.

    Attributes:
        name: name of the step.
        frame: frame that is held.
        position: [rad, m] position error of the fixture by component.  Components that
            are not listed are free.  With None, the fixture holds all six components at
            their present position.
        stiffness: [N m/rad, N/m] stiffness of the fixture by component.  Components
            that are not listed are rigid.
        kind: kind of step in results, ``"fix"`` or ``"clamp"``.
    """

    name: str
    frame: str
    position: Mapping[str, float] | None
    stiffness: Mapping[str, float] = field(default_factory=dict)
    kind: str = "fix"


@dataclass(frozen=True)
class Join:
    """A step that closes a closure or bolts a joint with clearance.

    Attributes:
        name: name of the step.
        part: names of the two frames of a closure, or name of the frame whose joint is
            bolted at its present position.
        locked: components of the opening that are locked at their present value.  All
            others are closed.
        force_limit: [N] largest closing force.
        leave_open: whether the opening that remains at the force limit is locked.
            Otherwise, the loop is closed, and the excess force is reported.
    """

    name: str
    part: Closure | str
    locked: tuple[str, ...] = ()
    force_limit: float = inf
    leave_open: bool = False


@dataclass(frozen=True, eq=False)
class Preload:
    """A step that applies a wrench to a body, until the step is released.

    Attributes:
        name: name of the step.
        frame: frame whose body is loaded.
        wrench: (6,) [N m, N] wrench at the frame's origin, base axes.
    """

    name: str
    frame: str
    wrench: NDArray


@dataclass(frozen=True)
class Release:
    """A step that removes the fixtures, clamps, preloads or joints of earlier steps.

    Attributes:
        name: name of the step.
        steps: names of the earlier steps.
    """

    name: str
    steps: tuple[str, ...]


@dataclass(frozen=True)
class Measure:
    """A step that measures a screw or an opening.

    Attributes:
        name: name of the step.
        part: frame whose screw is measured, or closure whose opening is measured.
        components: measured components.
    """

    name: str
    part: Closure | str
    components: tuple[str, ...] = SCREW


@dataclass(frozen=True)
class Adjust:
    """A step in which a shim or an adjustable joint compensates a measured value.

    Attributes:
        name: name of the step.
        frame: frame whose geometric error is changed.
        components: components of the error that are changed.
        reading: quantity to minimise: the screw of a frame, or the energy required to
            close a loop.
        increment: [rad or m] increment of the adjustment; 0 if it is continuous.
        amount: (a,) or (k, a) [rad or m] given adjustment; None to compute it.
    """

    name: str
    frame: str
    components: tuple[str, ...]
    reading: Measure
    increment: float = 0.0
    amount: NDArray | None = field(default=None, compare=False)


Step = Fix | Join | Preload | Release | Measure | Adjust


@dataclass(frozen=True)
class Plan:
    """The steps of an assembly.

    Closures that no step joins are closed before the first step.  Joints that no step
    bolts retain their clearance.

    Attributes:
        steps: the steps in order.
    """

    steps: tuple[Step, ...]

    def joined(self) -> set[Closure]:
        """Return the closures that the steps join."""
        parts = {s.part for s in self.steps if isinstance(s, Join)}
        return {part for part in parts if not isinstance(part, str)}


def check_plan(plan: Plan, robot: Robot) -> None:
    """Raise BadInput for a plan that is inconsistent.

    Args:
        plan: any plan.
        robot: the robot to be assembled.

    Raises:
        BadInput: a name is unknown or used twice, a closure or joint is joined twice, a
            released step is not active, or a drive of the robot is force-controlled.
    """
    driven = [frame.name for frame in robot.frames if frame.drive_force]
    if driven:
        raise BadInput(
            f"{robot.name}: frame {quoted(driven[0])}.drive_force: found a "
            "force-controlled drive, which assembly steps do not support; expected no "
            "drive_force"
        )
    taken = {closure_name(closure): "a closure" for closure in robot.closures}
    taken |= {GRAVITY: "the weights"}
    names: set[str] = set()
    held: dict[str, Closure | str | None] = {}
    for number, step in enumerate(plan.steps, 1):
        where = f"step[{number}] {quoted(step.name)}"
        if step.name in names:
            found = "found the name of an earlier step"
            raise BadInput(f"{where}: {found}, expected a new name")
        if step.name in taken:
            found = f"found the name of {taken[step.name]}"
            raise BadInput(f"{where}: {found}, expected a new name")
        names.add(step.name)
        for part in _parts_of(step):
            _check_part(where, part, robot)
        if isinstance(step, Join):
            _check_join(where, step, robot, held)
        if isinstance(step, (Fix, Preload, Join)):
            held[step.name] = step.part if isinstance(step, Join) else None
        if isinstance(step, Release):
            for name in step.steps:
                if name not in held:
                    found = f"found {quoted(name)}, which is not an active step"
                    raise BadInput(f"{where}.release: {found}; expected {_held(held)}")
                del held[name]


def _parts_of(step: Step) -> list[Closure | str]:
    """Return the frames and closures that a step refers to."""
    if isinstance(step, Release):
        return []
    if isinstance(step, (Join, Measure)):
        return [step.part]
    return [step.frame, *([step.reading.part] if isinstance(step, Adjust) else [])]


def _check_part(where: str, part: Closure | str, robot: Robot) -> None:
    """Raise BadInput for a frame or a closure that the robot does not have."""
    if isinstance(part, str):
        try:
            robot.index(part)
        except BadInput as error:
            raise BadInput(f"{where}: {error}") from None
    elif part not in robot.closures:
        known = ", ".join(f'["{a}", "{b}"]' for a, b in robot.closures) or "no closure"
        found = f'found no closure ["{part[0]}", "{part[1]}"]'
        raise BadInput(f"{where}: {found}, expected one of {known}")


def _check_join(where: str, step: Join, robot: Robot, held: Mapping) -> None:
    """Raise BadInput for a join that is impossible."""
    if step.part in held.values():
        raise BadInput(
            f"{where}.join: found a closure or frame that is joined already, expected "
            "another closure or frame"
        )
    if isinstance(step.part, str):
        frame = robot.frame(step.part)
        if frame.clearance is None and (not frame.passive or frame.compliant):
            found = f"found {quoted(step.part)}, whose joint has no clearance"
            raise BadInput(
                f"{where}.join: {found} and no motion to bolt, expected a frame whose "
                "joint can move"
            )


def _held(held: Mapping) -> str:
    """Return the names of the steps that a release can refer to, for error messages."""
    names = ", ".join(map(quoted, held))
    return f"one of {names}" if names else "an earlier step to release"


def closure_name(closure: Closure) -> str:
    """Return the name of a closure that is closed before the first step."""
    return f"{closure[0]} - {closure[1]}"


def rows_of(components: tuple[str, ...]) -> NDArray:
    """Return the indices of named components of a screw."""
    return np.array([SCREW.index(c) for c in components], dtype=int)
