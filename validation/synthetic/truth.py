"""Convert hidden effects to the truth format of the practice campaigns."""

from typing import Any

import numpy as np

from forcefit.assembly.model.statuses import (
    AMBIGUOUS,
    EXPLAINED,
    NONE_NEEDED,
    OUTSIDE_LIBRARY,
)
from forcefit.validation.synthetic.generator import Synthetic
from forcefit.validation.synthetic.machine import Hidden
from forcefit.validation.synthetic.outside import OUTSIDE

_UNITS = {
    "self_weight": "m/s^2",
    "thermal_expansion": "1/K",
    "drive_compliance": "N·m/rad",
    "base_compliance": "N·m/rad",
    "encoder_offset": "rad",
    "encoder_eccentricity": "rad",
    "link_length": "m",
    "registration": "rad",
    "modulus_scale": "1",
    "joint_clearance": "m",
    "friction_hysteresis": "N·m",
    "contact_stiffening": "N·m/rad^n",
    "load_gain": "N",
    "drift": "rad",
}
_SLIDING = {  # units of the parameters for prismatic joints and translations
    "drive_compliance": "N/m",
    "base_compliance": "N/m",
    "encoder_offset": "m",
    "friction_hysteresis": "N",
    "contact_stiffening": "N/m^n",
    "registration": "m",
    "drift": "m",
}


def truth_of(
    campaign: Synthetic,
    verdict: str | None = None,
    accept: list[list[str]] | None = None,
) -> dict[str, Any]:
    """Return the hidden effects of a campaign and the correct verdict.

    Args:
        campaign: campaign with its hidden effects.
        verdict: correct verdict of a diagnosis.  The default is correct if the design
            distinguishes the effects.
        accept: alternative sets of effects that explain the data equally well.

    Returns:
        Plain values with the keys of the truth format.
    """
    names = [effect.name for effect in campaign.effects]
    outside = [OUTSIDE[name] for name in names if name in OUTSIDE]
    if verdict is None:
        verdict = OUTSIDE_LIBRARY if outside else EXPLAINED
        verdict = verdict if names else NONE_NEEDED
    accepted = [[]] if outside else [names, *(accept or [])]
    residual = (campaign.readings - campaign.exact) / campaign.sigma
    added = campaign.added / campaign.sigma
    return {
        "robot": campaign.robot.name,
        "rows": len(campaign.plan.rows),
        "configurations": int(campaign.plan.configuration.max()) + 1,
        "verdict": verdict,
        "accept_verdicts": sorted({verdict, *([AMBIGUOUS] if accept else [])}),
        "effects": [_effect(campaign, effect) for effect in campaign.effects],
        "outside": "; ".join(outside) or None,
        "note": "",
        "contribution_rms": dict(campaign.strength),
        "total_contribution_rms": _rms(added),
        "noise_rms": 1.0,
        "normalised_before": _rms(residual + added),
        "normalised_perfect": _rms(residual),
        "sigma": {"rotation": campaign.sigma[0], "position": campaign.sigma[3]},
        "accept_effects": accepted,
        "registration": {
            "declared": campaign.registration,
            "hidden_base": campaign.hidden_base,
        },
        "outlier_rows": [f"m{i + 1:03d}" for i in campaign.outliers],
        "missing_cells": int(np.isnan(campaign.readings).sum()),
    }


def _effect(campaign: Synthetic, effect: Hidden) -> dict[str, Any]:
    """Return the name, frames and parameters of an effect."""
    names = [frame.name for frame in campaign.robot.frames]
    where: list[str] = []
    parameters = []
    for key, value in effect.parameters.items():
        frame = key if key in names else key.rpartition(".")[0]
        entry: dict[str, Any] = {"name": key, "value": value}
        if frame in names:
            entry["frame"] = frame
            where += [frame] if frame not in where else []
        entry["unit"] = _unit(campaign, effect.name, key, frame)
        parameters.append(entry)
    return {"name": effect.name, "where": where, "parameters": parameters}


def _unit(campaign: Synthetic, effect: str, key: str, frame: str) -> str:
    """Return the unit of a parameter."""
    last = key.rpartition(".")[2]
    special = {
        "phase": "rad", "tilt": "rad", "exponent": "1", "factor": "1",
        "time_constant": "s", "mx": "N·m", "my": "N·m", "mz": "N·m",
    }  # fmt: skip
    if last in special and key != frame:
        return special[last]
    slides = last in ("tx", "ty", "tz")
    if frame in (f.name for f in campaign.robot.frames):
        slides = campaign.robot.frame(frame).joint == "prismatic"
    return (_SLIDING if slides else _UNITS).get(effect, _UNITS.get(effect, ""))


def _rms(values: np.ndarray) -> float:
    """Return the root mean square of the measured values, or 1 if there are none."""
    known = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(known**2))) if known.size else 1.0
