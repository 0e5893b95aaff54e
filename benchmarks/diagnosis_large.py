"""Processor time and memory of diagnosing campaigns of 1000 and 3000 rows.

    python benchmarks/diagnosis_large.py FOLDER [--only 3rrr]

Robots are drawn as in ``diagnosis_confusion.py``, data come from the simulation's side.
FOLDER keeps the campaigns.
"""

import argparse
import resource
import time
from pathlib import Path

import numpy as np
from random_robots import Drawn, draw_robot

from assembly.robots import load_robot
from forcefit.inputs.table import BadInput
from validation.campaign.campaign_file import read_campaign
from validation.diagnosis.diagnose import diagnose
from validation.multibody.simulation import SimulationFailed, without_clearance
from validation.synthetic.design import CampaignDesign
from validation.synthetic.generator import Noise, generate_campaign, write_campaign

CASES = (  # robot, rows, configurations, what is hidden at 5 times the noise
    ("five_bar", 1000, 330, "drive_compliance"),
    ("3rrr", 1000, 330, "contact_stiffening"),
    ("delta", 1000, 330, "thermal_expansion"),
    ("hexapod", 1000, 330, "encoder_offset"),
    ("five_bar", 3000, 60, "link_length"),
    ("3rrr", 3000, 1000, "base_compliance"),
    ("arm6", 3000, 1000, "_pose_stiffness"),
    ("arm6", 100, 25, "_pose_stiffness"),
)
TRIES = 8  # draws of a robot until its simulation comes to rest


def make(folder: Path, case: int) -> None:
    """Write a case's campaign."""
    kind, rows, configurations, hidden = CASES[case]
    for attempt in range(TRIES):
        rng = np.random.default_rng([77, case, attempt])
        drawn = _arm(rng) if kind == "arm6" else draw_robot(rng, kind)
        design = CampaignDesign(
            configurations, rows, drawn.reach, load=drawn.load,
            reference_point=tuple(drawn.point),
        )  # fmt: skip
        try:
            campaign = generate_campaign(
                drawn.robot, {hidden: 5.0}, design, Noise(),
                int(rng.integers(2**31)), "springs",
            )  # fmt: skip
        except (SimulationFailed, BadInput):
            continue
        write_campaign(campaign, folder)
        return
    raise RuntimeError(f"{kind}: no robot that was drawn comes to rest")


def _arm(rng: np.random.Generator) -> Drawn:
    """The built-in arm of six joints, frames a little off as declared."""
    robot = without_clearance(load_robot("arm6"))
    size = np.repeat([2e-4, 1e-4], 3)
    errors = rng.uniform(-1, 1, (len(robot.frames), 6)) * size
    return Drawn("arm6", robot.with_errors(errors), 0.6, 60.0, np.zeros(3))


def main() -> None:
    """Make, diagnose, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", default="", help="a robot")
    asked = parser.parse_args()
    asked.folder.mkdir(parents=True, exist_ok=True)
    for case, (kind, rows, _, hidden) in enumerate(CASES):
        folder = asked.folder / f"{kind}_{rows}"
        if asked.only not in kind:
            continue
        if not folder.exists():
            make(folder, case)
        campaign = read_campaign(folder)
        started = time.process_time()
        diagnosis = diagnose(campaign)
        seconds = time.process_time() - started
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
        print(
            f"{kind:9s} {rows} rows, hidden {hidden}: {diagnosis.verdict} "
            f"{' + '.join(diagnosis.effects)}; {seconds:.0f} s, "
            f"at most {memory:.1f} GB so far",
            flush=True,
        )


if __name__ == "__main__":
    main()
