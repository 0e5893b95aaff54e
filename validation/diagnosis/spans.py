"""Which functions are learned from rows that follow one another.

Errors of such rows are not independent, so that evidence prefers what is large.  Spans
of time that were not fitted judge instead: of the candidates, one by one and by twos,
within a standard error of the best forecast that with the fewest numbers is kept.
Two together, for what is looked for one after the other stands for both at first: a
body warmed by two others looks like one that follows either with a delay.

Sources:
    Breiman, Friedman, Olshen, Stone (1984), Classification and regression trees,
    section 3.4.3: the simplest within a standard error.
"""

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from assembly.measurement.conditions import Conditions
from assembly.measurement.variables import variable
from validation.diagnosis.candidates import Candidate
from validation.diagnosis.remainder import Remainder

_PAIRS = 40  # that are judged, the likeliest
_ALIKE = 2.0  # twice a logarithm of probability that is no difference
_CLOCK = 0.999  # correlation with time of what counts it


def simplest(
    judged: Remainder, refined: Sequence[Candidate], worth: NDArray
) -> tuple[int, ...]:
    """The simplest candidates that foretell other spans nearly as well as any.

    Time by itself stands for whatever changed meanwhile, and is heard, alone, where
    nothing that was measured foretells anything.

    Args:
        judged: rows that follow one another.
        refined: candidates that show.
        worth: (len(refined),) how much likelier they make the readings.

    Returns:
        Places of one or two, the likelier first; none where none foretells anything.
    """
    first: dict[tuple[object, ...], int] = {}
    for i in np.argsort(-worth, kind="stable").tolist():
        one = refined[i]
        # other places do the same there
        first.setdefault((one.kind, one.parts[0].variable, one.shape), i)
    rows = judged.sensitivities
    conditions = rows.conditions.take(rows.rows)
    measured = [i for i in first.values() if not _follows_time(conditions, refined[i])]
    asked: list[tuple[int, ...]] = [(i,) for i in first.values()]
    asked += _likeliest_pairs(judged, refined, measured)
    some = {own: [refined[i] for i in own] for own in asked}
    proven = [own for own in asked if judged.foretells(some[own])]
    if not proven:
        return ()
    heard = [own for own in proven if set(own) <= set(measured)] or proven
    most = max(heard, key=lambda own: judged.gain(some[own])[0])
    behind = {own: judged.gain(some[most], some[own]) for own in heard}
    near = [own for own, (gain, error) in behind.items() if gain <= max(error, _ALIKE)]
    return min(near, key=lambda own: (_numbers(some[own]), behind[own][0]))


def _likeliest_pairs(
    judged: Remainder, refined: Sequence[Candidate], some: Sequence[int]
) -> list[tuple[int, ...]]:
    """The likeliest twos of candidates of different variables, by their places."""
    own = [refined[i] for i in some]
    pairs = [
        (i, j)
        for i, j in combinations(range(len(own)), 2)
        if own[i].parts[0].variable != own[j].parts[0].variable
    ]
    if not pairs:
        return []
    order = np.argsort(-judged.worths_of_pairs(own, pairs), kind="stable")
    return [(some[pairs[k][0]], some[pairs[k][1]]) for k in order[:_PAIRS]]


def _numbers(some: Sequence[Candidate]) -> int:
    """How many numbers candidates have, with those that were tried one by one."""
    return sum(len(one.shape.names) + len(one.shape.given) for one in some)


def _follows_time(conditions: Conditions, one: Candidate) -> bool:
    """Whether a candidate depends on time alone, or on what counts the rows."""
    variables = (variable(conditions, part.variable) for part in one.parts)
    time = conditions.time
    return all(abs(np.corrcoef(x, time)[0, 1]) > _CLOCK for x in variables)
