"""Evaluate slopes, limits and residuals of the cross-check for random errors.

Run ``python benchmarks/evidence/crosscheck_slopes.py [robot ...]``, which takes one or
two minutes.  It prints the tables of ``docs/crosscheck.md``.
"""

import itertools
import sys
import time

import numpy as np
from crosscheck_robots import drawn, hexapod, papers_robot, three_rrr

from forcefit.assembly.kinematics.posture import Posture, home_posture, place_robot
from forcefit.validation.crosscheck.crosscheck import crosscheck

POSES = [
    *[(0.0, -0.5), (0.2, -0.45), (-0.2, -0.45), (0.4, -0.45), (-0.4, -0.35)],
    *[(0.1, -0.15), (-0.15, -0.6), (0.3, -0.3), (-0.1, -0.35), (0.05, -0.25)],
]


def postures(name: str) -> list[Posture]:
    """Return thirty postures of a robot with random errors."""
    if name == "irsbot2":
        return [
            place_robot(papers_robot(seed, signed=seed % 2 == 1), {"tx": x, "tz": z})
            for (x, z), seed in itertools.product(POSES, range(3))
        ]
    make = {"hexapod": hexapod, "three_rrr": three_rrr}[name]
    return [home_posture(drawn(make(), seed, 2e-3, 2e-4)) for seed in range(30)]


def main() -> None:
    """Print a row of the table for each robot and each model of the links."""
    print("robot      links   passed  slope            limit    residual rot.    "
          "residual transl.  energy, linear and exact   seconds")  # fmt: skip
    names = sys.argv[1:] or ("irsbot2", "hexapod", "three_rrr")
    for name, links in itertools.product(names, ("beam", "spring")):
        started = time.perf_counter()
        answers = [crosscheck(posture, links=links) for posture in postures(name)]
        seconds = (time.perf_counter() - started) / len(answers)
        slopes = [s for a in answers for s in a.metric.slopes.values()]
        left = {h: [a.metric.unexplained[h] for a in answers]
                for h in ("rotation", "translation")}  # fmt: skip
        first = [a.pairs[0] for a in answers]
        linear = [abs(p.simulated.energy / p.linear.energy - 1) for p in first]
        exact = [abs(p.simulated.energy / p.exact.energy - 1) for p in first if p.exact]
        print(
            f"{name:10} {links:7} {sum(a.passed for a in answers):2}/{len(answers)}   "
            f"{min(slopes):.4f} {max(slopes):.4f}   "
            f"{max(c.value for a in answers for c in a.metric.limits.values()):.1e}  "
            f"{np.median(left['rotation']):.1e} {max(left['rotation']):.1e}  "
            f"{np.median(left['translation']):.1e} {max(left['translation']):.1e}   "
            f"{np.median(linear):.1e} {max(linear):.1e}; "
            f"{np.median(exact):.1e} {max(exact):.1e}   {seconds:.2f}"
        )


if __name__ == "__main__":
    main()
