"""Evaluate the position error of simulated robots before and after compensation.

    python benchmarks/evidence/compensation.py OUT.json --count 20 [--first 0]
        [--robots arm6]

Case k uses random numbers with the seed k.  The robot has six drives, or it is a Delta
robot.  It has one or two hidden effects, whose sizes are five times the noise.
Measurements are simulated and diagnosed.  The identified robot is used to correct the
commands at configurations that were not measured, and the robot is simulated with the
corrected commands.

The error is the distance from the target position, without noise and device errors.
The program also prints the rms error that a device with this noise would measure,
divided by the noise.  For a perfect robot, this ratio is 1.
"""

import argparse
import json
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.model.robot import Robot
from forcefit.assembly.robots import load_robot
from forcefit.inputs.table import BadInput
from forcefit.validation.campaign.campaign_file import read_campaign, read_commands
from forcefit.validation.correction.compensation import compensate
from forcefit.validation.diagnosis.diagnose import diagnose
from forcefit.validation.diagnosis.saving import corrected
from forcefit.validation.multibody.simulation import SimulationFailed, without_clearance
from forcefit.validation.synthetic.again import distances
from forcefit.validation.synthetic.design import (
    CampaignDesign,
    CampaignPlan,
    plan_campaign,
)
from forcefit.validation.synthetic.draws import NotApplicable
from forcefit.validation.synthetic.effects import LIBRARY
from forcefit.validation.synthetic.generator import (
    Noise,
    Synthetic,
    generate_campaign,
    write_campaign,
)
from forcefit.validation.synthetic.machine import acts_on_machine
from forcefit.validation.synthetic.outside import OUTSIDE

ROBOTS = ("arm6", "hexapod", "delta")
STRENGTH = 5.0
TARGETS = 12
TRIES = 20
NEAR = 1.2  # [-] largest error, relative to the noise, that counts as compensated
# self-weight, stiffening and clearance are excluded, because their size cannot be
# chosen
NAMES = [
    name for name in (*LIBRARY, *OUTSIDE)
    if acts_on_machine(name)
    and name not in {"joint_clearance", "geometric_stiffening", "body_mass"}
    and name not in {"delayed_expansion", "_tilting"}  # independent of commands
]  # fmt: skip


def draw_case(seed: int, robots: tuple[str, ...]) -> Synthetic:
    """Return a random robot with hidden effects, and its measurements."""
    for attempt in range(TRIES):
        rng = np.random.default_rng([seed, attempt])
        robot = without_clearance(load_robot(str(rng.choice(robots))))
        names = rng.choice(NAMES, int(rng.integers(1, 3)), replace=False)
        errors = rng.uniform(-1, 1, (len(robot.frames), 6)) * [*[2e-4] * 3, *[1e-4] * 3]
        try:
            return generate_campaign(
                robot.with_errors(errors) if not robot.closures else robot,
                dict.fromkeys(map(str, names), STRENGTH), _design(robot), Noise(),
                seed=int(rng.integers(2**31)), program="springs",
            )  # fmt: skip
        except (NotApplicable, SimulationFailed, BadInput):
            continue
    raise RuntimeError(f"case {seed}: no random robot can have the hidden effects")


def _design(robot: Robot) -> CampaignDesign:
    """Return the design of the measurements."""
    reach = 0.2 if robot.closures else 0.6
    return CampaignDesign(30, 120, reach, load=60.0, humidity=True)


def plan_table(plan: CampaignPlan) -> str:
    """Return the commands of a plan with loads and covariates as a table."""
    covariates = list(plan.rows[0].covariates)
    loads = [f"load.{axis}" for axis in ("mx", "my", "mz", "fx", "fy", "fz")]
    lines = [",".join(["id", *plan.columns, *loads, *(f"cov.{c}" for c in covariates)])]
    for i, row in enumerate(plan.rows):
        numbers = [*plan.commands[i], *row.load, *row.covariates.values()]
        lines.append(",".join([f"t{i}", *(f"{v:.12g}" for v in numbers)]))
    return "\n".join(lines) + "\n"


def run_case(seed: int, robots: tuple[str, ...]) -> dict[str, Any]:
    """Return the errors before and after compensation, divided by the noise."""
    begin = time.process_time()
    case = draw_case(seed, robots)
    design = replace(_design(case.robot), configurations=TARGETS, rows=TARGETS)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_campaign(case, folder / "campaign")
        found = diagnose(read_campaign(folder / "campaign"))
        for attempt in range(TRIES):
            rng = np.random.default_rng([seed, 999, *([attempt] if attempt else [])])
            plan = plan_campaign(case.robot, design, rng)
            (folder / "targets.csv").write_text(plan_table(plan))
            targets = read_commands(folder / "targets.csv", corrected(found))
            answer = compensate(targets)
            try:
                error = {
                    when: distances(case.robot, case.effects, targets, q, "springs")
                    for when, q in (
                        ("before", targets.coordinates), ("after", answer.coordinates)
                    )
                }  # fmt: skip
            except SimulationFailed:  # there is no equilibrium at a target
                continue
            break
        else:
            raise RuntimeError(f"case {seed}: found no targets that can be simulated")
    six = sum(frame.actuated for frame in case.robot.frames) >= 6
    return {
        "seed": seed, "robot": case.robot.name,
        "hidden": [effect.name for effect in case.effects],
        "verdict": found.verdict, "claimed": list(found.claimed),
        "before_um": _rms(error["before"][:, 0]) * 1e6,
        "after_um": _rms(error["after"][:, 0]) * 1e6,
        "expected_um": _rms(np.linalg.norm(
            np.hypot(answer.after, answer.spread)[:, 3:], axis=1)) * 1e6,
        "before": _against(error["before"], case.sigma, six),
        "after": _against(error["after"], case.sigma, six),
        "seconds": time.process_time() - begin,
    }  # fmt: skip


def _against(error: NDArray, sigma: NDArray, six: bool) -> float:
    """Return the rms error measured by a device with noise, divided by the noise."""
    parts = [error[:, 0] / sigma[3]] + ([error[:, 1] / sigma[0]] if six else [])
    return float(np.sqrt(1.0 + np.mean(np.square(parts)) / 3))


def _rms(values: NDArray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def main() -> None:
    """Compute all cases, write the results, and print the medians."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--robots", default=",".join(ROBOTS))
    given = parser.parse_args()
    robots = tuple(given.robots.split(","))
    answers = []
    for seed in range(given.first, given.first + given.count):
        answers.append(run_case(seed, robots))
        given.out.write_text(json.dumps(answers, indent=1))
        print(json.dumps(answers[-1]), flush=True)
    near = np.mean([answer["after"] <= NEAR for answer in answers])
    print(f"within {NEAR} of the noise: {near:.0%} of {len(answers)}")
    for key in ("before", "after", "before_um", "after_um"):
        values = np.array([answer[key] for answer in answers])
        ends = np.quantile(values, [0.5, 0.9])
        print(f"{key}: median {ends[0]:.3g}, 90 % {ends[1]:.3g}")


if __name__ == "__main__":
    main()
