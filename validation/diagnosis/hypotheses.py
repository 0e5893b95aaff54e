"""List the hypotheses of a diagnosis: library effects at certain frames.

An effect may act at one frame, at several frames with separate parameters, or at
several frames with a common parameter, where a group consists of all frames or of all
frames of one kind (``leg1.rod``, ``leg2.rod``).  Each case is a separate hypothesis.
Each fitted parameter of a hypothesis is called a slot.

Between sessions, the machine may be homed again, its tool changed or the device moved,
so an effect may have different parameters in each session.  Such a hypothesis contains
one copy of every slot per session, which acts only in the rows of this session.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.effects import LIBRARY
from forcefit.assembly.effects.effect import Effect, Unknown, at
from forcefit.assembly.measurement.conditions import Conditions
from forcefit.assembly.model.robot import Robot

PER_SESSION = ("registration", "encoder_offset", "drift")
# Largest number of unknowns of one effect; if an effect requires more, frames of one
# kind share an unknown.
_MOST_UNKNOWNS = 24


@dataclass(frozen=True)
class Slot:
    """A fitted parameter, which sets one or several unknowns of an effect.

    Attributes:
        names: names of the unknowns with this value.
        unknown: scale and bounds of the unknowns.
        start: start value of a fit.
        shape: whether the model is strongly nonlinear in the parameter, which is then
            fixed during screening.
        session: name of the only session in which the parameter acts; None for all
            sessions.
    """

    names: tuple[str, ...]
    unknown: Unknown
    start: float
    shape: bool = False
    session: str | None = None


@dataclass(frozen=True)
class Hypothesis:
    """Assumption that an effect acts at certain frames, with parameters to fit.

    Attributes:
        effect: name of the effect.
        where: frames at which the effect acts; empty for effects of the whole machine.
        slots: parameters to fit.
    """

    effect: str
    where: tuple[str, ...]
    slots: tuple[Slot, ...]

    def public(self, robot: Robot, x: Sequence[float] | NDArray) -> dict[str, float]:
        """Return the parameters by public name, in SI units, for slot values x."""
        values = {
            name: float(value)
            for slot, value in zip(self.slots, x, strict=True)
            for name in slot.names
        }
        return LIBRARY[self.effect].public(robot, values)

    @property
    def start(self) -> NDArray:
        """(k,) start values of a fit."""
        return np.array([slot.start for slot in self.slots])

    @property
    def bounds(self) -> tuple[NDArray, NDArray]:
        """(k,) lower and (k,) upper bounds."""
        return (
            np.array([slot.unknown.lower for slot in self.slots]),
            np.array([slot.unknown.upper for slot in self.slots]),
        )


def hypotheses(conditions: Conditions, loads: Sequence[str]) -> list[Hypothesis]:
    """Return all hypotheses that given conditions can test, ordered by effect.

    ``loads`` contains the load components that the campaign records, such as
    ``["fx"]``.
    """
    return [h for effect in LIBRARY.values() for h in _of(effect, conditions, loads)]


def _of(
    effect: Effect, conditions: Conditions, loads: Sequence[str]
) -> Iterator[Hypothesis]:
    """Yield the hypotheses of one effect."""
    for covariate in effect.needs:
        values = getattr(conditions, covariate)
        if not np.isfinite(values).all() or not np.any(values):
            return
    if effect.weighs and not conditions.gravity.any():
        return
    unknowns = effect.unknowns(conditions.robot)
    if effect.frames is None:
        for chosen in _choices(effect, unknowns, loads):
            yield from _scanned(
                effect, (), [((u.name,), u) for u in chosen], conditions
            )
        return
    places = (effect.tried or effect.frames)(conditions.robot)
    for groups in _groupings(places, len(unknowns)):
        slots = [
            (tuple(at(f, u.name) for f in group), u)
            for group in groups
            for u in unknowns
            if not u.scan
        ]
        where = tuple(f for group in groups for f in group)
        slots += [(tuple(at(f, u.name) for f in where), u) for u in unknowns if u.scan]
        yield from _scanned(effect, where, slots, conditions)


def _choices(
    effect: Effect, unknowns: tuple[Unknown, ...], loads: Sequence[str]
) -> Iterator[list[Unknown]]:
    """Yield subsets of the unknowns of an effect without frames, the full set first."""
    if effect.follows_load:
        # A load offset in a direction without recorded load is not a candidate.
        kept = {f"offset.{name}" for name in loads}
        unknowns = tuple(
            u for u in unknowns if u.name in kept or "offset." not in u.name
        )
    yield list(unknowns)
    parts = {u.name.partition(".")[0] for u in unknowns}
    if len(parts) > 1 and not any(u.scan for u in unknowns):
        for part in sorted(parts):
            yield [u for u in unknowns if u.name.partition(".")[0] == part]
    if effect.splits:
        for u in unknowns:
            yield [u]


def _groupings(
    places: tuple[str, ...], each: int
) -> Iterator[tuple[tuple[str, ...], ...]]:
    """Yield all partitions of frames into groups with common unknowns."""
    if not places:
        return
    kinds: dict[str, list[str]] = {}
    for name in places:
        kinds.setdefault(name.rpartition(".")[2], []).append(name)
    few = len(places) * each <= _MOST_UNKNOWNS
    ways: list[tuple[tuple[str, ...], ...]] = []
    if few:
        ways.append(tuple((p,) for p in places))
    ways.append(tuple(tuple(names) for names in kinds.values()))
    ways.append((places,))
    ways += [(tuple(names),) for names in kinds.values()]
    ways += [((p,),) for p in places]
    yield from dict.fromkeys(ways)


def _scanned(
    effect: Effect, where: tuple[str, ...],
    slots: list[tuple[tuple[str, ...], Unknown]], conditions: Conditions,
) -> Iterator[Hypothesis]:  # fmt: skip
    """Yield one hypothesis per start value of a shape parameter, or a single one."""
    scan: tuple[float, ...] = next((u.scan for _, u in slots if u.scan), (0.0,))
    by = next((u.scan_by for _, u in slots if u.scan_by), "")
    size = float(np.ptp(getattr(conditions, by))) if by else 1.0
    if size == 0.0:
        return
    for value in scan:
        yield Hypothesis(
            effect.name,
            where,
            tuple(
                Slot(names, u, value * size if u.scan else u.start, bool(u.scan))
                for names, u in slots
            ),
        )


def with_declared(listed: Sequence[Hypothesis], robot: Robot) -> list[Hypothesis]:
    """Return the hypotheses that can be combined with the declared effects.

    A declared effect and a hypothesis of the same effect must combine to a single
    effect.  Contact laws and delays are therefore omitted if one is declared, and a
    drift has the declared time constant.  Springs may be stiffer than declared.
    """
    curved = {
        (name, key.removesuffix(".coefficient").removesuffix(".time_constant"))
        for name in _CURVED
        for key in robot.effects.get(name, {})
    }
    constant = robot.effects.get("drift", {}).get("time_constant")
    kept: dict[Hypothesis, None] = {}
    for h in listed:
        if any((h.effect, frame) in curved for frame in h.where):
            continue
        if h.effect == "drift" and constant is not None:
            h = replace(h, slots=tuple(_held(s, constant) for s in h.slots))
        if h.effect in _SPRINGS and h.effect in robot.effects:
            soft = {k: 1 / v for k, v in robot.effects[h.effect].items()}
            h = replace(h, slots=tuple(_stiffer(s, soft) for s in h.slots))
        kept[h] = None
    return list(kept)


# Two instances of one of these nonlinear effects do not combine to a single effect.
_CURVED = ("contact_stiffening", "delayed_expansion")
_SPRINGS = ("drive_compliance", "base_compliance")


def _stiffer(slot: Slot, soft: Mapping[str, float]) -> Slot:
    """Return a slot whose compliances may offset declared compliances."""
    names = [
        n.removesuffix(".compliance").replace("compliance.", "stiffness.")
        for n in slot.names
    ]
    least = -min(soft.get(name, 0.0) for name in names)
    return replace(slot, unknown=replace(slot.unknown, lower=least))


def _held(slot: Slot, constant: float) -> Slot:
    """Return a slot of a drift with a fixed time constant."""
    if slot.names != ("time_constant",):
        return slot
    unknown = replace(slot.unknown, lower=constant, upper=constant, scan=())
    return replace(slot, unknown=unknown, start=constant)


def with_sessions(
    listed: Sequence[Hypothesis], sessions: Sequence[str], further: Sequence[str] = ()
) -> list[Hypothesis]:
    """Return the hypotheses and, in addition, those with parameters per session.

    The additional hypotheses exist only for several sessions.  They cover each effect
    of :data:`PER_SESSION` and ``further`` whose parameters are not shared among frames.
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
    """Return a hypothesis with separate parameters for every session."""
    slots = (replace(slot, session=name) for name in sessions for slot in h.slots)
    return replace(h, slots=tuple(slots))


def sessions_of(h: Hypothesis) -> tuple[str | None, ...]:
    """Return the sessions of the parameters, or (None,) if they apply to all rows."""
    return tuple(dict.fromkeys(slot.session for slot in h.slots)) or (None,)


def in_one_session(h: Hypothesis, session: str | None) -> tuple[Hypothesis, NDArray]:
    """Return a hypothesis restricted to one session, and its slots."""
    own = [k for k, s in enumerate(h.slots) if s.session in (None, session)]
    slots = tuple(replace(h.slots[k], session=None) for k in own)
    return replace(h, slots=slots), np.array(own, dtype=int)
