"""Combination of a declared effect with a difference that a diagnosis identified.

Effects act in sequence: first the declared one, then the identified one.  Both together
are equivalent to a single effect with other parameters: offsets and compliances are
added, factors multiplied, eccentricities added as vectors, rotations of frames
composed.
"""

import math
from collections.abc import Callable, Mapping

import numpy as np

from forcefit.assembly.effects.effect import RIGID, Values
from forcefit.assembly.effects.registration import BASE
from forcefit.stiffness.screws import rotation_matrix, rotation_vector

Effects = Mapping[str, Values]


def combined(declared: Effects, found: Effects) -> dict[str, dict[str, float]]:
    """Return the effects of a robot's file combined with additional effects.

    Args:
        declared: for each effect of the file its parameters by public name.
        found: for each additional effect, which acts after the declared one, its
            parameters by public name.

    Returns:
        Parameters of the single effects that are equivalent to both in sequence.

    Raises:
        ValueError: no single effect is equivalent, as for two contact laws in one
            joint, or two drifts with different time constants.
    """
    both = {name: dict(values) for name, values in declared.items()}
    for name, values in found.items():
        before = both.get(name)
        if not before:
            both[name] = dict(values)
        else:
            both[name] = _COMBINE.get(name, _sum)(before, values)
    return both


def _sum(declared: Values, found: Values) -> dict[str, float]:
    """Return for each parameter the sum of its declared and its found value."""
    return dict(declared) | {k: declared.get(k, 0.0) + v for k, v in found.items()}


def _in_series(declared: Values, found: Values) -> dict[str, float]:
    """Return the stiffnesses of springs in series; a missing spring is rigid."""
    both = {k: 1 / v for k, v in declared.items()}
    for k, v in found.items():
        both[k] = both.get(k, 0.0) + 1 / v
    return {k: 1 / c for k, c in both.items() if c > RIGID}


def _product(declared: Values, found: Values) -> dict[str, float]:
    """Return for each parameter the product of its declared and its found factor."""
    return dict(declared) | {k: declared.get(k, 1.0) * v for k, v in found.items()}


def _load(declared: Values, found: Values) -> dict[str, float]:
    """Return the combined load gains; the found gain acts after the declared gain."""
    factor = found.get("factor", 1.0)
    offsets = {k: factor * v for k, v in declared.items() if k != "factor"}
    more = {k: v for k, v in found.items() if k != "factor"}
    return {"factor": factor * declared.get("factor", 1.0), **_sum(offsets, more)}


def _eccentricity(declared: Values, found: Values) -> dict[str, float]:
    """Return amplitude and phase of the sum of two sines of one angle."""
    both = dict(declared)
    for key, amplitude in found.items():
        name, _, kind = key.rpartition(".")
        if kind != "amplitude":
            continue
        phase = f"{name}.phase"
        vector = amplitude * np.exp(1j * found.get(phase, 0.0))
        vector += declared.get(key, 0.0) * np.exp(1j * declared.get(phase, 0.0))
        both[key], both[phase] = float(abs(vector)), float(np.angle(vector))
    return both


def _registration(declared: Values, found: Values) -> dict[str, float]:
    """Return the composition of the declared and the found registration."""
    first, second = (np.array([v.get(k, 0.0) for k in BASE]) for v in (declared, found))
    R = rotation_matrix(second[:3])
    turn = rotation_vector(R @ rotation_matrix(first[:3]))
    placed = np.concatenate([turn, R @ first[3:] + second[3:]])
    tool = [{k: x for k, x in v.items() if k not in BASE} for v in (declared, found)]
    return {**_sum(*tool), **dict(zip(BASE, placed.tolist(), strict=True))}


def _drift(declared: Values, found: Values) -> dict[str, float]:
    """Return the summed amplitudes, with the common time constant."""
    constant = declared["time_constant"]
    if not math.isclose(found["time_constant"], constant, rel_tol=1e-9):
        raise ValueError(
            "two drifts of different time constants cannot be combined into one drift"
        )
    return {**_sum(declared, found), "time_constant": constant}


def _contact(declared: Values, found: Values) -> dict[str, float]:
    """Return the combined contact laws, which must be in different joints."""
    if set(declared) & set(found):
        raise ValueError(
            "two contact laws of one joint in series cannot be combined into one law"
        )
    return {**declared, **found}


def _delayed(declared: Values, found: Values) -> dict[str, float]:
    """Return the combined expansions; those of one body need equal time constants."""
    both = _sum(declared, found)
    for key in set(declared) & set(found):
        if key.endswith(".time_constant"):
            if not math.isclose(found[key], declared[key], rel_tol=1e-9):
                raise ValueError(
                    "two delayed expansions of one body with different time "
                    "constants cannot be combined into one"
                )
            both[key] = declared[key]
    return both


_COMBINE: dict[str, Callable[[Values, Values], dict[str, float]]] = {
    "drive_compliance": _in_series,
    "base_compliance": _in_series,
    "modulus_scale": _product,
    "load_gain": _load,
    "device_scale": _product,
    "encoder_eccentricity": _eccentricity,
    "registration": _registration,
    "drift": _drift,
    "delayed_expansion": _delayed,
    "contact_stiffening": _contact,
}
