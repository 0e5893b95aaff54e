"""Diagnose random robots with three points measured simultaneously.

    python -m benchmarks.evidence.diagnosis_points [--first 710000] [--count 10]
        [--hidden library|outside] [--common 1.0] [--device 5e-6]

Case k uses random numbers with the seed k.  They determine a robot (``random_robots``)
and 128 measurements at 64 configurations.  The device noise is 5 um.  In addition, all
points of a measurement have a common random motion of 20 um and 200 urad, multiplied by
``--common``.  There is no hidden effect, or a hidden effect at five times the common
noise.  The declared device noise is 5 um.

For each case, the program prints the verdict, the reported effects and functions, the
errors and the estimated noise.  It also counts the cases with a function, the cases
with the correct effect, and the 90 % intervals that contain the true parameter.
"""

import argparse
import sys
import tempfile
from pathlib import Path

import numpy as np

from forcefit.inputs.table import BadInput
from forcefit.validation.diagnosis.diagnose import diagnose
from forcefit.validation.diagnosis.diagnosis import Diagnosis
from forcefit.validation.diagnosis.results import table
from forcefit.validation.multibody.simulation import SimulationFailed
from forcefit.validation.synthetic.design import CampaignDesign
from forcefit.validation.synthetic.draws import NotApplicable
from forcefit.validation.synthetic.effects import LIBRARY
from forcefit.validation.synthetic.generator import Synthetic
from forcefit.validation.synthetic.outside import OUTSIDE
from tests.points_for_tests import DEVICE, MACHINE, simulated, write_points

sys.path.insert(0, str(Path(__file__).parent))
from random_robots import draw_robot

# effects that are excluded, because their size cannot be chosen
LEFT_OUT = {"joint_clearance", "geometric_stiffening", "self_weight"}
TRIES = 12


def machine(seed: int, hidden: str | None, common: float) -> Synthetic:
    """Return a random robot with a hidden effect."""
    for attempt in range(TRIES):
        rng = np.random.default_rng([seed, attempt])
        listed = list(OUTSIDE) if hidden == "outside" else list(LIBRARY)
        name = str(rng.choice([n for n in listed if n not in LEFT_OUT]))
        wanted = {name: 5.0} if hidden else {}
        try:
            drawn = draw_robot(rng)
            design = CampaignDesign(
                configurations=64, rows=128, reach=drawn.reach, load=drawn.load,
                reference_point=tuple(drawn.point),
            )  # fmt: skip
            noise = float(common * MACHINE[3]) or DEVICE
            return simulated(drawn.robot, wanted, design, seed, noise)
        except (NotApplicable, SimulationFailed, BadInput):
            continue
    raise RuntimeError(f"case {seed}: no random robot can have the hidden effects")


def covered(found: Diagnosis, made: Synthetic) -> tuple[int, int]:
    """Return the number of 90 % intervals with the true value, and of all intervals."""
    true = {e.name: e.parameters for e in made.effects}
    inside = [
        abs(p["value"] - true[e["name"]][p["name"]]) < 1.645 * p["std"]
        for e in table(found)["effects"] if e["name"] in true
        for p in e["parameters"] if p["name"] in true[e["name"]] and p["std"]
    ]  # fmt: skip
    return sum(inside), len(inside)


def main() -> None:
    """Diagnose all cases and count the results."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--first", type=int, default=710000)
    parser.add_argument("--count", type=int, default=10)
    parser.add_argument("--hidden", choices=["library", "outside"])
    parser.add_argument("--common", type=float, default=1.0)
    parser.add_argument("--device", type=float, default=DEVICE)
    asked = parser.parse_args()
    functions = named = 0
    inside = np.zeros(2, dtype=int)
    for seed in range(asked.first, asked.first + asked.count):
        made = machine(seed, asked.hidden, asked.common)
        names = tuple(effect.name for effect in made.effects)
        with tempfile.TemporaryDirectory() as folder:
            campaign = write_points(
                made, Path(folder) / "campaign", seed,
                common=asked.common * MACHINE, device=asked.device,
            )  # fmt: skip
            found = diagnose(campaign)
        functions += bool(found.fit.unknowns.functions)
        named += found.claimed == names
        inside += covered(found, made)
        turn, shift = found.traced.selected.noise.common
        print(
            f"{seed} {made.robot.name}: {', '.join(names) or 'nothing'}; "
            f"{found.verdict} {', '.join(found.claimed)}, "
            f"{len(found.fit.unknowns.functions)} functions; "
            f"{found.before.normalised:.2f} sigma before, {found.after.normalised:.2f} "
            f"after, {found.noise.normalised:.2f} noise; "
            f"common motion {1e6 * turn:.0f} urad, {1e6 * shift:.1f} um",
            flush=True,
        )
    print(
        f"{asked.count} cases: {functions} with functions, {named} with the hidden "
        f"effect, {inside[0]} of {inside[1]} intervals contain the true value"
    )


if __name__ == "__main__":
    main()
