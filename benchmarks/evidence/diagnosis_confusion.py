"""Compute the confusion matrix of the diagnosis over random synthetic campaigns.

    python benchmarks/evidence/diagnosis_confusion.py FOLDER --count 200  # make
    python benchmarks/evidence/diagnosis_confusion.py FOLDER --score      # count

Case k uses random numbers with the seed k.  They determine a robot (``random_robots``),
a design of measurements, and hidden effects.  The hidden effects are one effect of the
library at 2, 5 or 9 times the noise, two effects, no effect, an effect outside the
library, or an effect that the design cannot distinguish from another effect.
Measurements are simulated by ``forcefit.validation.synthetic.generator``.  Other
effects that explain them equally well are found by
``forcefit.validation.synthetic.equivalents``.  FOLDER contains all campaigns and
results, so that an interrupted run can be continued.

``diagnosis_score.py`` defines which results are correct.
"""

import argparse
import json
import shutil
import tempfile
import time
import traceback
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from diagnosis_score import VERDICTS, score
from numpy.typing import NDArray
from random_robots import draw_robot

from forcefit.assembly.files.robot_file import read_robot
from forcefit.inputs.table import BadInput
from forcefit.inputs.writing import plain, write_json
from forcefit.validation.campaign.campaign import Campaign
from forcefit.validation.diagnosis.diagnosis import Diagnosis
from forcefit.validation.diagnosis.prediction import residual_of
from forcefit.validation.diagnosis.results import table
from forcefit.validation.diagnosis.saving import save
from forcefit.validation.diagnosis.sequence import errors_of
from forcefit.validation.multibody.simulation import SimulationFailed
from forcefit.validation.synthetic.design import CampaignDesign, varied_for
from forcefit.validation.synthetic.draws import SLIDING, NotApplicable, draw_effect
from forcefit.validation.synthetic.effects import LIBRARY, Parameters
from forcefit.validation.synthetic.equivalents import SAME, Alternative, alternatives
from forcefit.validation.synthetic.generator import (
    Noise,
    Synthetic,
    generate_campaign,
    write_campaign,
)
from forcefit.validation.synthetic.machine import Hidden, simulate_readings
from forcefit.validation.synthetic.outside import OUTSIDE
from forcefit.validation.synthetic.truth import truth_of

MIX = {"single": 0.52, "none": 0.12, "pair": 0.16, "outside": 0.12, "confounded": 0.08}
STRENGTHS = (2.0, 5.0, 9.0)
TRIES = 12  # maximum number of attempts per case
FINE = 2e-7  # [m] lower limit of the noise
VISIBLE = 200.0  # [-] minimum chi-square that effects of the library do not explain
SMALL = 1e-2  # [-] factor by which errors and load are reduced for a linear response


def finite_part(campaign: Synthetic) -> NDArray:
    """Return the linearisation error of the measurements, (rows, 6) [rad, m]."""
    robot, rows = campaign.robot, campaign.plan.rows

    def readings(scale: float) -> NDArray:
        scaled = [replace(row, load=scale * row.load) for row in rows]
        machine = robot.with_errors(scale * robot.errors)
        point = campaign.reference_point
        return simulate_readings(machine, point, scaled, (), "springs")

    return readings(1.0) - (readings(SMALL) - readings(-SMALL)) / (2 * SMALL)


def draw_case(seed: int, only: str | None = None) -> tuple[str, Synthetic]:
    """Return the kind of a case and its campaign."""
    for attempt in range(TRIES):
        rng = np.random.default_rng([seed, attempt])
        kind = str(rng.choice(list(MIX), p=list(MIX.values())))
        kind = only or kind
        try:
            campaign = _measure(kind, rng)
        except (NotApplicable, SimulationFailed, BadInput):
            continue
        if campaign.sigma[3] >= FINE:
            return kind, campaign
    raise RuntimeError(f"case {seed}: no random robot can have the hidden effects")


def _measure(kind: str, rng: np.random.Generator) -> Synthetic:
    """Return a campaign of the given kind."""
    names = _effects(kind, rng)
    kinds = dict.fromkeys(SLIDING, "gantry")
    kinds |= dict.fromkeys(("joint_clearance", "_torque_backlash"), "arm")
    drawn = draw_robot(rng, next((kinds[n] for n in names if n in kinds), None))
    robot, load = drawn.robot, drawn.load
    # fewer measurements are simulated for robots with many legs, which are slow
    many = len(robot.frames) > 20
    design = CampaignDesign(
        configurations=12 if many else 24,
        rows=60 if many else 116,
        reach=drawn.reach,
        load=load,
        reference_point=tuple(drawn.point),
        humidity=rng.random() < 0.3,
    )
    design = varied_for(design, names)
    wanted = {name: float(rng.choice(STRENGTHS)) for name in names}
    if "geometric_stiffening" in names:  # this effect is small without large errors
        robot = robot.with_errors(30 * robot.errors)
    if kind != "confounded":
        return generate_campaign(
            robot, wanted, design, Noise(), int(rng.integers(2**31)), "springs"
        )
    # a longer beam and a permanently warmer beam cannot be distinguished
    hidden = Hidden(names[0], _one_beam(names[0], robot, rng))
    fixed = replace(design, temperature="constant")
    return generate_campaign(
        robot, [(hidden, wanted[names[0]])], fixed, Noise(),
        int(rng.integers(2**31)), "springs",
    )  # fmt: skip


def _effects(kind: str, rng: np.random.Generator) -> list[str]:
    """Return the names of the hidden effects."""
    library = list(LIBRARY)
    if kind == "none":
        return []
    if kind == "outside":
        return [str(rng.choice(list(OUTSIDE)))]
    if kind == "confounded":
        return [str(rng.choice(["thermal_expansion", "link_length"]))]
    if kind == "single":
        return [str(rng.choice(library))]
    library.remove("geometric_stiffening")
    return [str(n) for n in rng.choice(library, 2, replace=False)]


def _one_beam(name: str, robot: Any, rng: np.random.Generator) -> Parameters:
    """Return parameters of an effect at a single beam."""
    given = dict(draw_effect(name, robot, 1.0, rng).parameters)
    first = str(rng.choice(list(given)))
    return {first: given[first]}


def truth_with_rivals(kind: str, campaign: Synthetic) -> dict[str, Any]:
    """Return the hidden effects, and other sets that explain the data equally well."""
    names = sorted(effect.name for effect in campaign.effects)
    # two effects of the library may explain an effect outside the library
    most = 2 if len(names) == 2 or kind == "outside" else 1
    rivals = alternatives(campaign, most) if names else []
    same = {
        tuple(sorted(_plain(one)))
        for one in rivals
        if one.residual < SAME and tuple(sorted(_plain(one))) != tuple(names)
    }
    # a model without effects explains the data if the hidden effects are very small
    unseen = float(np.nansum((campaign.added / campaign.sigma) ** 2)) < SAME
    accept = [list(one) for one in sorted(same)] + ([[]] if unseen else [])
    if kind == "none":  # near a singularity, declared errors may cause finite motions
        chi2 = float(np.nansum((finite_part(campaign) / campaign.sigma) ** 2))
        accept += [["geometric_stiffening"]] if chi2 > SAME else []
    verdict = "ambiguous" if kind == "confounded" else None
    truth = truth_of(campaign, verdict, accept)
    if kind == "outside":
        least = rivals[0].residual if rivals else np.inf
        truth["accept_effects"] = [[]]
        truth["hidden_from_library"] = least
        truth["accept_verdicts"] = ["outside_library"]
        if least < VISIBLE:  # effects of the library explain the hidden effect
            truth["accept_verdicts"] = list(VERDICTS)
            hidden = [one for one in rivals if one.residual < VISIBLE]
            truth["accept_effects"] += [_plain(one) for one in hidden]
    truth["kind"] = kind
    truth["alternatives"] = [
        {
            "names": list(one.names),
            "parameters": one.parameters,
            "left_chi2": one.residual,
        }
        for one in rivals[:8]
    ]
    return truth


def _plain(one: Alternative) -> list[str]:
    """Return the names of effects; drifts with any time constant have the same name."""
    return [name.partition("(")[0] for name in one.names]


def make(
    folder: Path, seed: int, only: str | None = None, understated: float = 1.0
) -> None:
    """Write the campaign and the hidden effects of a case unless they exist.

    The standard deviation in the campaign is too small by the factor ``understated``.
    """
    name = f"c{seed:04d}"
    if (folder / "truths" / f"{name}.json").exists():
        return
    kind, campaign = draw_case(seed, only)
    shutil.rmtree(folder / "campaigns" / name, ignore_errors=True)
    stated = replace(campaign, sigma=campaign.sigma / understated)
    write_campaign(stated, folder / "campaigns" / name)
    truth = plain(truth_with_rivals(kind, campaign))
    write_json({name: truth}, str(folder / "truths" / f"{name}.json"))


def answer(folder: Path, seed: int) -> None:
    """Diagnose a case and write the result unless it exists."""
    from forcefit.validation.campaign.campaign_file import read_campaign
    from forcefit.validation.diagnosis.diagnose import diagnose

    name = f"c{seed:04d}"
    target = folder / "answers" / f"{name}.json"
    if target.exists():
        return
    started = time.process_time()
    campaign = read_campaign(folder / "campaigns" / name)
    try:
        found = diagnose(campaign)
        diagnosis = table(found) | _saved(found, campaign)
    except Exception:  # exceptions are results, which are counted
        diagnosis = {"verdict": "crashed", "why": traceback.format_exc()}
    diagnosis["seconds"] = time.process_time() - started
    write_json(diagnosis, str(target))


def _saved(found: Diagnosis, campaign: Campaign) -> dict[str, Any]:
    """Compare the error of the saved robot file with errors before saving."""
    if not found.better:
        return {}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "robot.toml"
        save(found, path)
        left = residual_of(campaign, read_robot(path))
    rows = ~found.outliers
    after = errors_of(campaign, left, rows).normalised
    before = errors_of(campaign, found.residual_before, rows).normalised
    return {
        "read_back": after / found.saved.normalised,
        "saved_worse": bool(after > before),
    }


def main() -> None:
    """Create campaigns, diagnose them, and evaluate the results."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument(
        "--kind", choices=MIX, help="create only campaigns of this kind"
    )
    parser.add_argument("--step", type=int, default=1, help="use every STEP-th case")
    parser.add_argument(
        "--understated", type=float, default=1.0,
        help="factor by which the standard deviation in the campaign is too small",
    )  # fmt: skip
    parser.add_argument("--make", action="store_true", help="only create campaigns")
    parser.add_argument("--answer", action="store_true", help="only diagnose campaigns")
    parser.add_argument("--score", action="store_true", help="only evaluate results")
    asked = parser.parse_args()
    for name in ("campaigns", "truths", "answers"):
        (asked.folder / name).mkdir(parents=True, exist_ok=True)
    if not asked.score:
        for seed in range(asked.first, asked.first + asked.count, asked.step):
            started = time.perf_counter()
            try:
                if not asked.answer:
                    make(asked.folder, seed, asked.kind, asked.understated)
            except SimulationFailed as error:
                print(f"case {seed}: omitted, {error}", flush=True)
            made = (asked.folder / "truths" / f"c{seed:04d}.json").exists()
            if made and not asked.make:
                answer(asked.folder, seed)
            print(f"case {seed}: {time.perf_counter() - started:.0f} s", flush=True)
    if not asked.make:
        scores = score(asked.folder)
        write_json(scores, str(asked.folder / "score.json"))
        print(json.dumps(scores, indent=1))


if __name__ == "__main__":
    main()
