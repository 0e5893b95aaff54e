"""Combine an effect of the robot file with an effect identified by a diagnosis.

The effect of the file acts first.  Both effects together are equivalent to a single
effect.  Offsets and compliances are added, factors are multiplied, eccentricities are
added as vectors, and frame rotations are composed.
"""

import math
from collections.abc import Callable, Mapping

import numpy as np

from forcefit.assembly.effects.effect import RIGID, Values
from forcefit.assembly.effects.registration import BASE
from forcefit.stiffness.screws import rotation_matrix, rotation_vector

Effects = Mapping[str, Values]


def combined(declared: Effects, found: Effects) -> dict[str, dict[str, float]]:
    """Combine the effects of a robot file with additional effects.

    Args:
        declared: parameters of each effect in the file, by public name.
        found: parameters of each additional effect by public name.  Additional effects
            act after those of the file.

    Returns:
        Parameters of the equivalent single effects.

    Raises:
        ValueError: there is no equivalent single effect, for example for two contact
            laws in one joint.
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
    """Add the values of each parameter in the file and in the diagnosis."""
    return dict(declared) | {k: declared.get(k, 0.0) + v for k, v in found.items()}


def _in_series(declared: Values, found: Values) -> dict[str, float]:
    """Return the stiffness of springs in series; a missing spring is rigid."""
    both = {k: 1 / v for k, v in declared.items()}
    for k, v in found.items():
        both[k] = both.get(k, 0.0) + 1 / v
    return {k: 1 / c for k, c in both.items() if c > RIGID}


def _product(declared: Values, found: Values) -> dict[str, float]:
    """Multiply the factors of each parameter in the file and in the diagnosis."""
    return dict(declared) | {k: declared.get(k, 1.0) * v for k, v in found.items()}


def _load(declared: Values, found: Values) -> dict[str, float]:
    """Combine load gains; the gain of the file acts first."""
    factor = found.get("factor", 1.0)
    offsets = {k: factor * v for k, v in declared.items() if k != "factor"}
    more = {k: v for k, v in found.items() if k != "factor"}
    return {"factor": factor * declared.get("factor", 1.0), **_sum(offsets, more)}


def _eccentricity(declared: Values, found: Values) -> dict[str, float]:
    """Return amplitude and phase of the sum of two sines of the same angle."""
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
    """Compose the registrations of the file and of the diagnosis."""
    first, second = (np.array([v.get(k, 0.0) for k in BASE]) for v in (declared, found))
    R = rotation_matrix(second[:3])
    turn = rotation_vector(R @ rotation_matrix(first[:3]))
    placed = np.concatenate([turn, R @ first[3:] + second[3:]])
    tool = [{k: x for k, x in v.items() if k not in BASE} for v in (declared, found)]
    return {**_sum(*tool), **dict(zip(BASE, placed.tolist(), strict=True))}


def _drift(declared: Values, found: Values) -> dict[str, float]:
    """Add the amplitudes of drifts with the same time constant."""
    constant = declared["time_constant"]
    if not math.isclose(found["time_constant"], constant, rel_tol=1e-9):
        raise ValueError(
            "two drifts with different time constants cannot be combined into one drift"
        )
    return {**_sum(declared, found), "time_constant": constant}


def _contact(declared: Values, found: Values) -> dict[str, float]:
    """Combine the contact laws of different joints."""
    if set(declared) & set(found):
        raise ValueError(
            "two contact laws in series at one joint cannot be combined into one law"
        )
    return {**declared, **found}


def _delayed(declared: Values, found: Values) -> dict[str, float]:
    """Combine expansions; time constants of the same body must be equal."""
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
