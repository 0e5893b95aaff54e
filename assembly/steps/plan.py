"""Assembly plan: the steps as data.

A frame's screw is expressed at the frame's origin in its axes, after its joint.  The
opening of a closure is expressed at the origin of the closure's first frame, in the
axes of that frame; after a drawn joint, at the joint's point and in its axes.
Components are named ``RX RY RZ TX TY TZ`` as for a screw.
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
GRAVITY = "gravity"  # name of the weight in the dictionary of acting loads


@dataclass(frozen=True)
class Fix:
    """A step in which a fixture holds a frame in position.

    Attributes:
        name: name of the step.
        frame: frame that is held.
        position: [rad, m] fixture error by component; unlisted components are free.
            None to hold all six components where the frame lies.
        stiffness: [N m/rad, N/m] fixture stiffness by component; unlisted components
            are rigid.
        kind: ``"fix"`` or ``"clamp"``, the kind of step named in results.
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
        part: the two frames of a closure, or the frame whose joint is bolted as it
            lies.
        locked: components of the closure's opening that are bolted as they lie; all
            others are closed.
        force_limit: [N] largest closing force.
        leave_open: whether the opening that remains at the force limit is locked in.
            Otherwise the closure is closed, and the excess force is reported.
    """

    name: str
    part: Closure | str
    locked: tuple[str, ...] = ()
    force_limit: float = inf
    leave_open: bool = False


@dataclass(frozen=True, eq=False)
class Preload:
    """A step that applies a wrench to a frame's body, until the step is released.

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
    """A step that removes fixtures, clamps, preloads or joints of earlier steps.

    Attributes:
        name: name of the step.
        steps: names of the earlier steps to release together.
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
    """A step in which a shim or an adjustable joint compensates a reading.

    Attributes:
        name: name of the step.
        frame: frame whose geometric error is changed.
        components: components of the error that are changed.
        reading: quantity to minimise: components of a frame's screw, or the energy
            required to close a closure.
        increment: [rad or m] changes are rounded to multiples of this value; 0 for
            continuous changes.
        amount: (a,) or (k, a) [rad or m] change made regardless of the reading, from
            :func:`forcefit.assembly.steps.amounts.with_best_amounts`.
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
    """The steps of assembly, in order.

    Closures that are not joined by any step are closed before the first step. Joints
    that are not bolted by any step retain their clearance.

    Attributes:
        steps: the steps.
    """

    steps: tuple[Step, ...]

    def joined(self) -> set[Closure]:
        """Return the closures that the steps join."""
        parts = {s.part for s in self.steps if isinstance(s, Join)}
        return {part for part in parts if not isinstance(part, str)}


def check_plan(plan: Plan, robot: Robot) -> None:
    """Reject steps that are inconsistent with the robot or with each other.

    Args:
        plan: any plan.
        robot: the robot to be assembled.

    Raises:
        BadInput: a name is unknown or used twice, a part is joined twice, a step
            releases something that is not held, or a drive of the robot applies a
            force. The message starts with the step.
    """
    driven = [frame.name for frame in robot.frames if frame.drive_force]
    if driven:
        raise BadInput(
            f"{robot.name}: frame {quoted(driven[0])}.drive_force: found a drive that "
            "applies a force, which steps of assembly do not compute; expected none"
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
                    found = f"found {quoted(name)}, which nothing holds"
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
    """Reject a frame or a closure that the robot does not have."""
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
    """Reject a part that is already joined, and a joint without clearance to bolt."""
    if step.part in held.values():
        raise BadInput(f"{where}.join: found a part that is joined already")
    if isinstance(step.part, str):
        frame = robot.frame(step.part)
        if frame.clearance is None and (not frame.passive or frame.compliant):
            found = f"found {quoted(step.part)}, whose joint has no clearance"
            raise BadInput(f"{where}.join: {found} and no motion to bolt")


def _held(held: Mapping) -> str:
    """List the names of the steps that may be released."""
    names = ", ".join(map(quoted, held))
    return f"one of {names}" if names else "an earlier step that holds something"


def closure_name(closure: Closure) -> str:
    """Return the name of a closure that is closed before the first step."""
    return f"{closure[0]} - {closure[1]}"


def rows_of(components: tuple[str, ...]) -> NDArray:
    """Return the indices of components of a screw."""
    return np.array([SCREW.index(c) for c in components], dtype=int)
