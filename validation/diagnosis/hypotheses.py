"""List the hypotheses of a diagnosis, which are library effects at certain frames.

An effect may act at one frame or at several frames, with separate or common parameters.
Each of these possibilities is a separate hypothesis. A fitted parameter of a hypothesis
is called a slot.

Between sessions, the machine may be homed, its tool may be changed, or the measuring
device may be moved.  An effect may therefore have different parameters in each session.
Such a hypothesis contains one copy of every slot for each session.
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
# Largest number of unknowns of one effect.  If an effect has more, similar frames share
# an unknown.
_MOST_UNKNOWNS = 24


@dataclass(frozen=True)
class Slot:
    """A fitted parameter, which is the value of one or several unknowns of an effect.

    Attributes:
        names: names of the unknowns with this value.
        unknown: scale and bounds of the unknowns.
        start: start value of a fit.
        shape: whether the readings depend on the parameter in a strongly nonlinear way.
        session: name of the session to which the parameter applies.  None for all
            sessions.
    """

    names: tuple[str, ...]
    unknown: Unknown
    start: float
    shape: bool = False
    session: str | None = None


@dataclass(frozen=True)
class Hypothesis:
    """Assumption that an effect acts at certain frames.

    Attributes:
        effect: name of the effect.
        where: frames at which the effect acts, empty for effects of the whole machine.
        slots: parameters to fit.
    """

    effect: str
    where: tuple[str, ...]
    slots: tuple[Slot, ...]

    def public(self, robot: Robot, x: Sequence[float] | NDArray) -> dict[str, float]:
        """Return the effect parameters in SI units, by public name."""
        values = {
            name: float(value)
            for slot, value in zip(self.slots, x, strict=True)
            for name in slot.names
        }
        return LIBRARY[self.effect].public(robot, values)

    @property
    def start(self) -> NDArray:
        """Start values (k,) of a fit."""
        return np.array([slot.start for slot in self.slots])

    @property
    def bounds(self) -> tuple[NDArray, NDArray]:
        """Lower bounds (k,) and upper bounds (k,)."""
        return (
            np.array([slot.unknown.lower for slot in self.slots]),
            np.array([slot.unknown.upper for slot in self.slots]),
        )


def hypotheses(conditions: Conditions, loads: Sequence[str]) -> list[Hypothesis]:
    """Return all hypotheses that can be tested under given conditions.

    ``loads`` contains the recorded load components, such as ``["fx"]``.
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
    """Yield sets of unknowns to fit for an effect without frames."""
    if effect.follows_load:
        # An offset is fitted only for recorded load components.
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
    """Yield all ways to divide frames into groups with common parameters."""
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
    """Yield one hypothesis for each start value of a shape parameter."""
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

    A hypothesis of a declared effect is included only if both together are equivalent
    to a single effect. Declared contact laws and delays are therefore omitted.
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


# Effects for which the sum of two instances is not equivalent to a single instance.
_CURVED = ("contact_stiffening", "delayed_expansion")
_SPRINGS = ("drive_compliance", "base_compliance")


def _stiffer(slot: Slot, soft: Mapping[str, float]) -> Slot:
    """Return a fitted parameter that permits joints to be stiffer than declared."""
    names = [
        n.removesuffix(".compliance").replace("compliance.", "stiffness.")
        for n in slot.names
    ]
    least = -min(soft.get(name, 0.0) for name in names)
    return replace(slot, unknown=replace(slot.unknown, lower=least))


def _held(slot: Slot, constant: float) -> Slot:
    """Return a fitted parameter of a drift whose time constant is fixed."""
    if slot.names != ("time_constant",):
        return slot
    unknown = replace(slot.unknown, lower=constant, upper=constant, scan=())
    return replace(slot, unknown=unknown, start=constant)


def with_sessions(
    listed: Sequence[Hypothesis], sessions: Sequence[str], further: Sequence[str] = ()
) -> list[Hypothesis]:
    """Return the hypotheses, and hypotheses with separate parameters for each session.

    The latter are returned only for several sessions.  They cover each effect of
    :data:`PER_SESSION` and ``further``.
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
    """Return a hypothesis with separate parameters for each session."""
    slots = (replace(slot, session=name) for name in sessions for slot in h.slots)
    return replace(h, slots=tuple(slots))


def sessions_of(h: Hypothesis) -> tuple[str | None, ...]:
    """Return the sessions of the parameters, or (None,) if there are no sessions."""
    return tuple(dict.fromkeys(slot.session for slot in h.slots)) or (None,)


def in_one_session(h: Hypothesis, session: str | None) -> tuple[Hypothesis, NDArray]:
    """Return the hypothesis for one session, and its fitted parameters."""
    own = [k for k, s in enumerate(h.slots) if s.session in (None, session)]
    slots = tuple(replace(h.slots[k], session=None) for k in own)
    return replace(h, slots=slots), np.array(own, dtype=int)
