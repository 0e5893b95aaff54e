"""What the linearised closures cost, over the size of the errors.

Run ``python benchmarks/crosscheck_validity.py``; about a minute.  For each size of the
errors the simulation (beams as links, no clearances) is compared with the linear and
with the exact virtual-joint model; it prints a table of ``docs/crosscheck.md``.
"""

import itertools

import numpy as np
from crosscheck_robots import drawn, hexapod, papers_robot

from assembly.posture import Posture, home_posture, place_robot
from validation.crosscheck import crosscheck

SCALES = (2.0, 1.0, 0.5, 0.25, 0.1)
POSES = [(0.0, -0.5), (0.2, -0.45), (-0.2, -0.45), (0.4, -0.45), (-0.4, -0.35)]


def postures(name: str) -> list[Posture]:
    """Twenty cases: IRSbot-2 at 5 poses x 4 draws, or 20 draws of the hexapod."""
    if name == "hexapod":
        return [home_posture(drawn(hexapod(), k, 2e-2, 2e-4)) for k in range(20)]
    return [
        place_robot(papers_robot(seed, signed=seed % 2 == 1), {"tx": x, "tz": z})
        for (x, z), seed in itertools.product(POSES, range(4))
    ]


def main() -> None:
    """Print one row for each robot and size of the errors."""
    print("robot    errors [rad]  position, linear [um]   rotation, linear [urad]   "
          "energy, linear [%]   position, exact [um]  energy, exact [%]")  # fmt: skip
    for name in ("irsbot2", "hexapod"):
        answers = [crosscheck(posture, scales=SCALES) for posture in postures(name)]
        for k, scale in enumerate(SCALES):
            pairs = [answer.pairs[k] for answer in answers]
            linear = np.array([p.screw_difference for p in pairs])
            known = [p for p in pairs if p.exact is not None]
            exact = np.array([
                p.simulated.platform_screw - p.exact.platform_screw for p in known
            ])
            energy = [p.simulated.energy / p.linear.energy - 1 for p in pairs]
            left = [p.simulated.energy / p.exact.energy - 1 for p in known]
            columns = (
                1e6 * np.linalg.norm(linear[:, 3:], axis=1),
                1e6 * np.linalg.norm(linear[:, :3], axis=1),
                100 * np.abs(energy),
                1e6 * np.linalg.norm(exact[:, 3:], axis=1),
                100 * np.abs(left),
            )
            cells = [f"{np.median(c):.2g} ({c.max():.2g})" for c in columns]
            print(f"{name:8} {2e-2 * scale:<12.3g}", *(f"{c:22}" for c in cells))


if __name__ == "__main__":
    main()
