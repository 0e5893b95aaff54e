"""Cross-check IRSBot-2 with distal links that are finite-element solids.

Run ``python benchmarks/evidence/crosscheck_solids.py``, which takes one or two minutes.
It prints a table of ``docs/crosscheck.md``.
"""

import time
from pathlib import Path

from crosscheck_robots import papers_robot

from forcefit.assembly.files.solved_links import solve_links
from forcefit.assembly.kinematics.posture import place_robot
from forcefit.assembly.model.robot import MeshLink
from forcefit.validation.crosscheck.crosscheck import crosscheck

SURFACE = Path(__file__).parents[2] / "meshes" / "distal_plain.stl"


def main() -> None:
    """Print a row of the table for each set of errors and each model of the links."""
    link = MeshLink(SURFACE, "z=0", "z=0.452", 60e9, 0.3)
    names = [f"leg{leg}.link_{side}" for leg in (1, 2) for side in "ab"]
    print("draw  links   passed  slope   limit    residual rot.  residual transl.  "
          "energy against exact  seconds")  # fmt: skip
    for seed in range(3):
        robot = papers_robot(seed, signed=seed % 2 == 1)
        meshed = solve_links(robot.with_links(dict.fromkeys(names, link)))
        posture = place_robot(meshed, {"tx": 0.1, "tz": -0.45})
        for links in ("spring", "fem"):
            started = time.perf_counter()
            check = crosscheck(posture, links=links)
            first = check.pairs[0]
            energy = first.simulated.energy / first.exact.energy - 1
            print(
                f"{seed:4}  {links:7} {check.passed!s:6}  {check.slope:.4f}  "
                f"{max(c.value for c in check.metric.limits.values()):.1e}  "
                f"{check.metric.unexplained['rotation']:.1e}        "
                f"{check.metric.unexplained['translation']:.1e}           {energy:.1e}"
                f"              {time.perf_counter() - started:.1f}"
            )


if __name__ == "__main__":
    main()
