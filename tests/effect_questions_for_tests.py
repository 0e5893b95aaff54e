"""Readings changed by effects and functions, for ``answers_for_tests.py``."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from forcefit.assembly.effects import LIBRARY, apply_effects
from forcefit.assembly.effects.functions import apply_functions
from forcefit.assembly.measurement.predict import predict
from forcefit.assembly.measurement.settled_clearance import with_clearances_taken_up
from forcefit.assembly.measurement.variables import with_history
from forcefit.assembly.model.function import Function
from forcefit.validation.campaign.campaign_file import read_campaign
from forcefit.validation.diagnosis.signatures import conditions_of

CAMPAIGNS = Path(__file__).parent / "campaigns"
NAMES = ("encoder_offset", "base_compliance_drift")


def rows(name: str, nudge: float, count: int = 12) -> Any:
    """Return the conditions of the first rows of a campaign."""
    campaign = read_campaign(CAMPAIGNS / name)
    campaign = replace(campaign, loads=campaign.loads * (1 + nudge))
    return conditions_of(campaign.take(np.arange(len(campaign)) < count))


def sized(effect: Any, robot: Any, places: tuple[str, ...]) -> dict[str, float]:
    """Return parameters of an effect that decrease from one frame to the next."""
    values = {}
    for k, place in enumerate(places):
        for u in effect.unknowns(robot):
            size = u.start + 0.7 * u.scale / (1 + k)
            full = f"{place}.{u.name}" if place and u.name else place or u.name
            values[full] = float(np.clip(size, u.lower, u.upper))
    return effect.public(robot, values)


def effects(name: str, nudge: float) -> Any:
    """Predict readings with each effect of the library."""
    conditions = rows(name, nudge)
    robot, found = conditions.robot, {}
    for key, effect in LIBRARY.items():
        if effect.finite:
            continue
        places = effect.frames(robot) if effect.frames else ("",)
        changed = apply_effects(conditions, {key: sized(effect, robot, places)})
        read = predict(with_clearances_taken_up(changed)[0])
        found[key] = {"read": read.deviation, "reason": list(read.reason)}
    return found


def finite_effects(name: str, nudge: float) -> Any:
    """Predict readings with finite motions and each effect of the library."""
    conditions = replace(rows(name, nudge, 2), exact=True)
    robot, found = conditions.robot, {}
    for key, effect in LIBRARY.items():
        if not effect.clearance:
            places = effect.frames(robot)[:1] if effect.frames else ("",)
            changed = apply_effects(conditions, {key: sized(effect, robot, places)})
            found[key] = predict(changed).deviation
    return found


DRIVE = "q.leg1.drive"
WHERE: Any = {"where": "leg1.drive", "components": ("rz",), "variables": (DRIVE,)}
FUNCTIONS = [
    Function(**WHERE, form="powers", parameters={"0": 1e-4, "1": 2e-4, "2": -1e-4}),
    Function(
        **WHERE | {"variables": (DRIVE, "load.fx")}, form="powers",
        parameters={"1.1": 1e-5, "0.1": -2e-5, "2.0": 3e-5},
    ),
    Function(
        **WHERE, form="waves",
        parameters={"1.sine": 2e-4, "2.cosine": 1e-4, "period": 0.7},
    ),
    Function(
        **WHERE, form="spline",
        parameters={"first": -1.5, "last": 1.0, "1": 1e-4, "2": -2e-4, "3": 3e-4},
    ),
    *(
        Function(
            "reading", ("tx", "rz"), ("cov.temperature",), form,
            {"gain": 1e-5, "start": 2e-5, "time_constant": 200.0},
        )
        for form in ("lag", "creep")
    ),
    Function("base", ("ty",), ("cov.time",), "step", {"at": 400.0, "size": 3e-5}),
    Function(
        "reading", ("tz",), ("cov.time",), "slow_wave",
        {"period": 900.0, "sine": 1e-5, "cosine": 2e-5},
    ),
    Function(**WHERE, form="reversal", parameters={"0": 1e-4}),
    Function("load", ("fx",), ("load.fx",), "powers", {"1": 0.1, "2": 1e-3}),
    Function(
        **WHERE | {"variables": ("wrench.leg1.drive.mz",)}, form="powers",
        parameters={"1": 1e-5, "3": 1e-7}, kind="screw",
    ),
    Function(**WHERE, form="powers", parameters={"0": 1e-5}, kind="compliance"),
]  # fmt: skip


def functions(nudge: float) -> Any:
    """Predict readings with functions of all forms."""
    conditions = with_history(rows("base_compliance_drift", nudge))
    return {
        f"function_{k}": predict(apply_functions(conditions, [one])).deviation
        for k, one in enumerate(FUNCTIONS)
    }


EFFECTS: dict[str, Callable[[float], Any]] = {
    **{f"effects of {name}": partial(effects, name) for name in NAMES},
    **{f"finite effects, {name}": partial(finite_effects, name) for name in NAMES},
    "functions": functions,
}
