"""Decide which effects of a fitted machine the readings support.

An effect is supported if it satisfies three conditions. The change of the readings due
to the effect exceeds the uncertainty of this change. Noise alone is unlikely to cause
this change. No nonlinear parameter, such as a time constant, is at a bound, and no
other parameter is at its upper bound.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from forcefit.assembly.effects.combine import combined
from forcefit.validation.diagnosis.fit import MachineFit
from forcefit.validation.diagnosis.lack_of_fit import UNLIKELY
from forcefit.validation.diagnosis.separability import orthonormal_basis
from forcefit.validation.diagnosis.unknowns import STEP, Acting, effects_in

# An unknown is treated as being at a bound if its relative distance from the bound is
# smaller than this value.
_AT_BOUND = 1e-3


def supported(fit: MachineFit, one: Acting) -> bool:
    """Return whether the readings support an effect of the fitted machine.

    The pose of the measuring frame is always supported, because every campaign has a
    measuring frame.
    """
    slots = one.hypothesis.slots
    if one.device or not slots:
        return True
    x, C, slopes = fit.own(one)
    for slot, value in zip(slots, x, strict=True):
        if _at_bound(slot.unknown.upper, value):
            return False
        if slot.shape and _at_bound(slot.unknown.lower, value):
            return False
    shape = np.array([slot.shape for slot in slots])
    begin = np.array([slot.unknown.start for slot in slots])
    moved = np.where(shape, 0.0, x - begin)
    slopes = _without_devices(fit, slopes)
    size = float(np.sum((slopes @ moved) ** 2))
    unsure = float(np.einsum("ni,ij,nj->", slopes, C, slopes))
    seen = ~shape & (np.linalg.norm(slopes, axis=0) > 0.0)
    if not seen.any() or size <= unsure:
        return False
    inverse = np.linalg.pinv(C[np.ix_(seen, seen)], hermitian=True)
    wald = float(moved[seen] @ inverse @ moved[seen])
    return float(chi2.sf(wald, int(seen.sum()))) < UNLIKELY


def _without_devices(fit: MachineFit, slopes: NDArray) -> NDArray:
    """Return derivatives (n, k) after projecting out motions of the device."""
    own = [fit.own(one)[2] for one in fit.unknowns.effects if one.device]
    if not own:
        return slopes
    Q = orthonormal_basis(np.hstack(own))
    return slopes - Q @ (Q.T @ slopes)


def _at_bound(bound: float, value: float) -> bool:
    """Return whether a value equals a finite bound."""
    return bool(np.isfinite(bound) and abs(value - bound) <= _AT_BOUND * abs(bound))


@dataclass(frozen=True)
class Parameter:
    """Identified parameter of an effect, in the unit of the robot file.

    Attributes:
        name: public name.
        value: identified value, which includes the declared value.
        std: standard deviation of the value.
        declared: value in the robot file, None if absent.
        difference: value minus declared value.
    """

    name: str
    value: float
    std: float
    declared: float | None
    difference: float


def parameters_of(fit: MachineFit, one: Acting) -> list[Parameter]:
    """Return the parameters of an effect on which the readings depend."""
    h, robot = one.hypothesis, fit.unknowns.robot.without_effects()
    declared = effects_in(fit.unknowns.robot, one.session).get(h.effect, {})
    x, C, _ = fit.own(one)

    def public(x: NDArray) -> dict[str, float]:
        found = h.public(robot, x)
        both = combined({h.effect: declared}, {h.effect: found})[h.effect]
        return {name: both[name] for name in found if name in both}

    value, difference = public(x), h.public(robot, x)
    J = np.zeros((len(value), len(x)))
    phase = np.array([name.endswith(".phase") for name in value], dtype=bool)
    for i, slot in enumerate(h.slots):
        step = STEP * max(abs(x[i]), 1e-3 * slot.unknown.scale)
        ends = []
        for sign in (1.0, -1.0):
            moved = x.copy()
            moved[i] += sign * step
            there = public(moved)
            ends.append(np.array([there.get(name, np.nan) for name in value]))
        change = ends[0] - ends[1]
        around = np.remainder(change + np.pi, 2 * np.pi) - np.pi
        J[:, i] = np.where(phase, around, change) / (2 * step)
    std = np.sqrt(np.maximum(np.einsum("pi,ij,pj->p", J, C, J), 0.0)).tolist()
    # Parameters without influence on the readings are omitted.
    shown = np.any(J[:, fit.seen(one)] != 0, axis=1).tolist()
    return [
        Parameter(name, v, s, declared.get(name), difference[name])
        for (name, v), s, kept in zip(value.items(), std, shown, strict=True)
        if kept
    ]
