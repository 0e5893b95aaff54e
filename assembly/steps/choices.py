"""Rules for permuting the steps of a plan.

Consecutive joins and adjustments may be permuted.  An adjustment of a closure and the
step that joins this closure keep their order.
"""

from collections.abc import Iterator
from itertools import groupby

from forcefit.assembly.steps.influence import depends_on_state
from forcefit.assembly.steps.plan import Adjust, Join, Step


def choices(left: tuple[Step, ...]) -> Iterator[tuple[Step, tuple[Step, ...]]]:
    """Yield each step that may be next, with the remaining steps.

    Args:
        left: steps that are not yet completed, in the order of the plan.

    Yields:
        A step, and the remaining steps.
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
    """Return whether one of two steps adjusts the closure that the other step joins."""
    steps = {type(one): one, type(other): other}
    join, adjust = steps.get(Join), steps.get(Adjust)
    if not isinstance(join, Join) or not isinstance(adjust, Adjust):
        return False
    return join.part == adjust.reading.part


def movable_runs(steps: tuple[Step, ...]) -> list[list[Step]]:
    """Return all sequences of consecutive joins and adjustments in a plan.

    Args:
        steps: steps of a plan.

    Returns:
        Sequences in which the steps may be permuted.
    """
    runs = groupby(steps, lambda step: isinstance(step, (Join, Adjust)))
    return [list(run) for movable, run in runs if movable]


def order_matters(run: list[Step]) -> bool:
    """Return whether the state after a sequence of steps depends on their order.

    Args:
        run: sequence of steps, see :func:`movable_runs`.

    Returns:
        True if the sequence contains a join, and a step whose result depends on the
        state before it.
    """
    joins = [step for step in run if isinstance(step, Join)]
    return any(map(depends_on_state, run if joins else joins))
