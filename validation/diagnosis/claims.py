"""Which effects of a fitted machine the readings support.

An effect is claimed only if what it changes in the readings exceeds the uncertainty of
that change, the chance of as large a change without it is small, and none of its
unknowns that give it its name is at a bound.
"""

from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from assembly.effects import LIBRARY
from assembly.effects.combine import combined
from assembly.effects.effect import Values
from assembly.model.robot import Robot
from validation.diagnosis.fit import MachineFit
from validation.diagnosis.unknowns import Acting

_CHANCE = 1e-3  # probability of as large an effect where there is none
_AT_BOUND = 1e-3  # of a bound's distance from the start: the unknown is at the bound
_RANK = 1e-9  # relative singular value of a direction that others do as well
_STEP = 1e-4  # of an unknown's size, for derivatives of public parameters
_NOTHING: Values = MappingProxyType({})


def supported(fit: MachineFit, one: Acting) -> bool:
    """Whether the readings support an effect.

    Args:
        fit: of the machine that has it.
        one: the effect.

    Returns:
        True for the place of the measuring frame, which is always there.
    """
    if one.device or not one.hypothesis.slots:
        return True
    x, C, slopes = fit.own(one)
    begin = np.array([s.unknown.start for s in one.hypothesis.slots])
    shape = np.array([s.shape for s in one.hypothesis.slots])
    if any(
        _at_bound(s.unknown.upper, v)
        for s, v in zip(one.hypothesis.slots, x, strict=True)
    ):
        return False
    if np.any(shape & _at_lower(one, x)):
        return False
    moved = np.where(shape, 0.0, x - begin)
    slopes = _without_devices(fit, slopes)
    size = float(np.sum((slopes @ moved) ** 2))
    unsure = float(np.einsum("ni,ij,nj->", slopes, C, slopes))
    seen = ~shape & (np.linalg.norm(slopes, axis=0) > 0.0)
    if not seen.any() or size <= unsure:
        return False
    inverse = np.linalg.pinv(C[np.ix_(seen, seen)], hermitian=True)
    wald = float(moved[seen] @ inverse @ moved[seen])
    return float(chi2.sf(wald, int(seen.sum()))) < _CHANCE


def _without_devices(fit: MachineFit, slopes: NDArray) -> NDArray:
    """(n, k) slopes without what the place of a measuring device does as well."""
    places = zip(fit.unknowns.effects, fit.unknowns.slices, strict=False)
    own = [fit.slopes[:, place] for one, place in places if one.device]
    if not own:
        return slopes
    flat = np.hstack(own)
    flat = flat / np.maximum(np.linalg.norm(flat, axis=0), 1e-300)
    Q, size, _ = np.linalg.svd(flat, full_matrices=False)
    Q = Q[:, size > _RANK * size.max(initial=0.0)]
    return slopes - Q @ (Q.T @ slopes)


def _at_bound(bound: float, value: float) -> bool:
    """Whether a value is at a finite bound."""
    return bool(np.isfinite(bound) and abs(value - bound) <= _AT_BOUND * abs(bound))


def _at_lower(one: Acting, x: NDArray) -> NDArray:
    """(k,) bool, unknowns at their lower bound."""
    slots = zip(one.hypothesis.slots, x, strict=True)
    return np.array([_at_bound(s.unknown.lower, v) for s, v in slots])


def parameters_of(
    robot: Robot,
    one: Acting,
    x: NDArray,
    C: NDArray,
    declared: Values = _NOTHING,
    seen: NDArray | None = None,
) -> list[tuple[str, float, float]]:
    """Public name, value and standard deviation of a machine's parameters.

    Args:
        robot: without effects.
        one: the effect.
        x: (k,) values of its unknowns.
        C: (k, k) their covariance.
        declared: parameters of the same effect in the robot's file.
        seen: (k,) bool, unknowns that some reading depends on; all if absent.

    Returns:
        Parameters that were found, in the units of the public format: of the machine,
        with what was declared.
    """
    h = one.hypothesis

    def public(x: NDArray) -> dict[str, float]:
        found = h.public(robot, x)
        both = combined({h.effect: declared}, {h.effect: found})[h.effect]
        return {name: both[name] for name in found if name in both}

    value = public(x)
    J = np.zeros((len(value), len(x)))
    phase = np.array([name.endswith(".phase") for name in value], dtype=bool)
    for i, slot in enumerate(h.slots):
        step = _STEP * max(abs(x[i]), 1e-3 * slot.unknown.scale)
        ends = []
        for sign in (1.0, -1.0):
            moved = x.copy()
            moved[i] += sign * step
            there = public(moved)
            ends.append(np.array([there.get(name, np.nan) for name in value]))
        change = ends[0] - ends[1]
        around = np.remainder(change + np.pi, 2 * np.pi) - np.pi
        J[:, i] = np.where(phase, around, change) / (2 * step)
    std = np.sqrt(np.maximum(np.einsum("pi,ij,pj->p", J, C, J), 0.0))
    # what no reading depends on, such as a component that was not measured
    acting = J if seen is None else J[:, seen]
    shown = np.any(acting != 0, axis=1).tolist()
    return [
        (name, v, float(s))
        for (name, v), s, kept in zip(value.items(), std, shown, strict=True)
        if kept
    ]


def unit_of(effect: str, robot: Robot, name: str) -> str:
    """Unit of an effect's parameter."""
    return LIBRARY[effect].unit(robot, name)
