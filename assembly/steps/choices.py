"""Which steps of a plan may change places.

Joins and adjustments that follow each other may; an adjustment to a closure stays on
its side of the step that joins this closure.
"""

from collections.abc import Iterator
from itertools import groupby

from forcefit.assembly.steps.influence import depends_on_state
from forcefit.assembly.steps.plan import Adjust, Join, Step


def choices(left: tuple[Step, ...]) -> Iterator[tuple[Step, tuple[Step, ...]]]:
    """Yield the steps that may come next, with those that are left then.

    Args:
        left: steps that are not yet carried out, in the order of the plan.

    Yields:
        A step, and the steps left after it.
    """
    for i, step in enumerate(left):
        movable = isinstance(step, (Join, Adjust))
        if i and not movable:
            return
        if not any(_keep_order(earlier, step) for earlier in left[:i]):
            yield step, left[:i] + left[i + 1 :]
        if not movable:
            return


def _keep_order(one: Step, other: Step) -> bool:
    """Return whether one step adjusts a closure that the other one joins."""
    steps = {type(one): one, type(other): other}
    join, adjust = steps.get(Join), steps.get(Adjust)
    if not isinstance(join, Join) or not isinstance(adjust, Adjust):
        return False
    return join.part == adjust.reading.part


def movable_runs(steps: tuple[Step, ...]) -> list[list[Step]]:
    """Return the runs of steps that may change places among themselves.

    Args:
        steps: of a plan.

    Returns:
        The runs of consecutive joins and adjustments.
    """
    runs = groupby(steps, lambda step: isinstance(step, (Join, Adjust)))
    return [list(run) for movable, run in runs if movable]


def order_matters(run: list[Step]) -> bool:
    """Return whether the state after a run depends on its order.

    Args:
        run: see :func:`movable_runs`.

    Returns:
        True if a step holds what it finds, and a part is joined.
    """
    joins = [step for step in run if isinstance(step, Join)]
    return any(map(depends_on_state, run if joins else joins))
