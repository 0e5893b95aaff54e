"""Hypotheses whose numbers belong to the sessions of a campaign.

Between sessions a machine is homed again, its tool is changed and its device is moved:
an effect may have numbers of its own in each.  Such a hypothesis has every slot once
for each session; a session's slots act in its rows alone.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from validation.diagnosis.hypotheses import Hypothesis

PER_SESSION = ("registration", "encoder_offset", "drift")


def with_sessions(
    listed: Sequence[Hypothesis], sessions: Sequence[str], further: Sequence[str] = ()
) -> list[Hypothesis]:
    """Hypotheses, and those of effects that may differ from session to session.

    Args:
        listed: of a campaign.
        sessions: its names.
        further: effects that may differ, beside :data:`PER_SESSION`.

    Returns:
        The same; and, where there are several sessions, each that shares no number
        among frames once more, with numbers for every session.
    """
    if len(sessions) < 2:
        return list(listed)
    own = [
        h
        for h in listed
        if h.effect in {*PER_SESSION, *further}
        and all(slot.shape or len(slot.names) == 1 for slot in h.slots)
    ]
    return [*listed, *(_each(h, sessions) for h in own)]


def _each(h: Hypothesis, sessions: Sequence[str]) -> Hypothesis:
    """A hypothesis with numbers for every session."""
    slots = (replace(slot, session=name) for name in sessions for slot in h.slots)
    return replace(h, slots=tuple(slots))


def sessions_of(h: Hypothesis) -> tuple[str | None, ...]:
    """The sessions in which a hypothesis has numbers of its own, else None alone."""
    return tuple(dict.fromkeys(slot.session for slot in h.slots)) or (None,)


def in_one_session(h: Hypothesis, session: str | None) -> tuple[Hypothesis, NDArray]:
    """What a hypothesis says of one session, as if of all.

    Args:
        h: with numbers for every session, or for all.
        session: its name.

    Returns:
        A hypothesis of the numbers that act there, and which of its slots they are.
    """
    own = [k for k, s in enumerate(h.slots) if s.session in (None, session)]
    slots = tuple(replace(h.slots[k], session=None) for k in own)
    return replace(h, slots=slots), np.array(own, dtype=int)
