"""Compare the number of measurements of planned campaigns and of random campaigns.

    python benchmarks/evidence/plan_rows.py OUT.json --count 50 [--first 0]

Case k uses random numbers with the seed k.  They determine a robot and an effect of the
library, whose rms in random measurements is STRENGTH sigma.  Campaigns of increasing
size are simulated with this effect and noise.  Their measurements are planned, or
random within the same ranges.  Each campaign is diagnosed.  The required number of
measurements is the smallest number beyond which all diagnoses are correct.
"""

import argparse
import json
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.effects import LIBRARY, apply_effects
from forcefit.assembly.measurement.predict import predict
from forcefit.assembly.model.robot import Robot
from forcefit.assembly.robots import load_robot
from forcefit.validation.campaign.campaign import Campaign
from forcefit.validation.diagnosis.diagnose import diagnose
from forcefit.validation.diagnosis.hypotheses import hypotheses
from forcefit.validation.diagnosis.signatures import conditions_of, loaded_components
from forcefit.validation.inspection.planning import plan_rows, rows_as_campaign
from forcefit.validation.multibody.simulation import without_clearance
from forcefit.validation.synthetic.design import CampaignDesign, plan_campaign

ROBOTS = ("arm6", "five_bar")
ROWS = (8, 12, 16, 24, 32, 48)
STRENGTH = 1.0  # [sigma]
SIGMA = (1e-5, 5e-6)
# excluded effects, because they are not estimated or their size cannot be chosen
NOT_DRAWN = {"joint_clearance", "registration", "self_weight", "geometric_stiffening"}
NAMES = [name for name in LIBRARY if name not in NOT_DRAWN]


def design_of(robot: Robot) -> CampaignDesign:
    """Return the design of the measurements."""
    return CampaignDesign(120, 120, 0.2 if robot.closures else 0.6, load=60.0)


def random_rows(robot: Robot, rows: int, rng: np.random.Generator) -> Campaign:
    """Return a campaign with random measurements."""
    design = replace(design_of(robot), configurations=rows, rows=rows)
    plan = plan_campaign(robot, design, rng)
    return rows_as_campaign(robot, plan, design, SIGMA)


def draw_effect(
    campaign: Campaign, rng: np.random.Generator
) -> tuple[str, dict[str, float]]:
    """Return an effect whose rms is STRENGTH sigma."""
    conditions = conditions_of(campaign)
    every = hypotheses(conditions, loaded_components(campaign))
    name = str(rng.choice([n for n in NAMES if any(h.effect == n for h in every)]))
    one = max((h for h in every if h.effect == name), key=lambda h: len(h.slots))
    part = rng.uniform(0.4, 1.0, len(one.slots))
    signs = [rng.choice([-1, 1]) if s.unknown.lower < 0 else 1 for s in one.slots]

    def at(size: float) -> dict[str, float]:
        x = [
            s.start if s.shape else np.clip(
                s.unknown.start + size * u * s.unknown.scale, s.unknown.lower,
                s.unknown.upper,
            )
            for s, u in zip(one.slots, part * signs, strict=True)
        ]  # fmt: skip
        return one.public(campaign.robot, np.array(x))

    def shows(size: float) -> float:
        change = predict(apply_effects(conditions, {name: at(size)})).deviation
        change = change - predict(conditions).deviation
        return float(np.sqrt(np.mean((change / campaign.sigma) ** 2)))

    low, high = 1e-6, 1e3
    for _ in range(60):
        middle = np.sqrt(low * high)
        low, high = (middle, high) if shows(middle) < STRENGTH else (low, middle)
    return name, at(float(np.sqrt(low * high)))


def is_right(campaign: Campaign, name: str, values: dict[str, float],
             rng: np.random.Generator) -> bool:  # fmt: skip
    """Return whether the diagnosis of a campaign contains only the given effect."""
    conditions = apply_effects(conditions_of(campaign), {name: values})
    noise = campaign.sigma * rng.normal(size=campaign.measured.shape)
    found = diagnose(replace(campaign, measured=predict(conditions).deviation + noise))
    return found.verdict == "explained" and set(found.claimed) == {name}


def needed(right: list[bool]) -> int:
    """Return the number of measurements beyond which all diagnoses are correct."""
    wrong = [k for k, good in enumerate(right) if not good]
    first = wrong[-1] + 1 if wrong else 0
    return ROWS[first] if first < len(ROWS) else 2 * ROWS[-1]


def run_case(seed: int) -> dict[str, Any]:
    """Return the required numbers of planned and of random measurements."""
    begin = time.process_time()
    rng = np.random.default_rng([seed, 14])
    robot: Robot = without_clearance(load_robot(str(rng.choice(ROBOTS))))
    name, values = draw_effect(random_rows(robot, 120, rng), rng)
    right: dict[str, list[bool]] = {"planned": [], "random": []}
    for rows in ROWS:
        plan = plan_rows(robot, rows, design_of(robot), SIGMA, seed)
        campaigns: dict[str, Campaign] = {
            "planned": rows_as_campaign(robot, plan.plan, plan.design, SIGMA),
            "random": random_rows(robot, rows, rng),
        }
        for how, campaign in campaigns.items():
            right[how].append(is_right(campaign, name, values, rng))
    return {
        "seed": seed, "robot": robot.name, "effect": name,
        **{how: needed(answers) for how, answers in right.items()},
        "right": right, "seconds": time.process_time() - begin,
    }  # fmt: skip


def summary(answers: list[dict[str, Any]]) -> str:
    """Return medians, and fractions of correct diagnoses for each campaign size."""
    rows = {h: np.array([a[h] for a in answers]) for h in ("planned", "random")}
    lines = [
        f"{how}: median {np.median(count):g} rows, mean {count.mean():.1f}"
        for how, count in rows.items()
    ]
    saved = 1 - rows["planned"] / rows["random"]
    lines.append(f"saved: median {np.median(saved):.0%}, of all rows together "
                 f"{1 - rows['planned'].sum() / rows['random'].sum():.0%}")  # fmt: skip
    shares: dict[str, NDArray] = {
        how: np.mean([a["right"][how] for a in answers], axis=0) for how in rows
    }
    for k, count in enumerate(ROWS):
        lines.append(f"{count} rows: correct {shares['planned'][k]:.0%} planned, "
                     f"{shares['random'][k]:.0%} random")  # fmt: skip
    return "\n".join(lines)


def main() -> None:
    """Compute all cases, write the results, and print a summary."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--count", type=int, default=50)
    parser.add_argument("--first", type=int, default=0)
    given = parser.parse_args()
    answers = []
    for seed in range(given.first, given.first + given.count):
        answers.append(run_case(seed))
        given.out.write_text(json.dumps(answers, indent=1))
        print(json.dumps(answers[-1]), flush=True)
    print(summary(answers))


if __name__ == "__main__":
    main()
