"""Prints the largest difference from each number of the IRSbot-2 reference table.

Run from the repository's root: ``python benchmarks/irsbot2_against_reference.py``.  The
table (``tests/irsbot2_numbers.json``: 2 draws of errors at 6 poses) was made by another
program; its own optimality gap is about 1e-10 of the energy without play.
"""

import json
import sys
from collections import defaultdict
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent))

from assembly.kinematics.posture import place_robot
from assembly.linear.energy import solve_assembly
from assembly.linear.pose_error import bound_pose_error
from assembly.linear.zone import zone_margin
from tests.robots_for_tests import NUMBERS, irsbot2_with, paper_frame


def halves(computed, expected):
    """Largest difference of rotations (moments) and shifts (forces), each relative."""
    computed, expected = np.reshape(computed, (2, 3)), np.reshape(expected, (2, 3))
    return float((np.abs(computed - expected).max(1) / np.abs(expected).max(1)).max())


def compare(case, point, worst):
    """Differences at one pose, the largest kept by name."""
    robot = irsbot2_with(case)
    posture = place_robot(robot, pose={"tx": point["x"], "tz": point["z"]})
    assembly = solve_assembly(posture)

    def note(name, value):
        worst[name] = max(worst[name], value)

    T = posture.transforms
    link, elbow = (T[robot.index(f"leg1.{n}")] for n in ("link_a", "elbow_a"))
    for bounds, key in ((elbow[:3, 3], "E_A"), (link[:3, 3], "F_A"),
                       (link[:3, 0], "u_A"), (link[:3, 2], "z7_A")):  # fmt: skip
        note("frames [m, -]", float(np.abs(bounds - point[key]).max()))
    note("energy [relative]", abs(assembly.energy / point["energy"] - 1))
    note("platform screw [relative]", halves(assembly.platform_screw, point["x_opt"]))
    for key, value in point["b_rz"].items():
        spring = assembly.joint_screws[robot.index(paper_frame(key)), 2]
        note("compliant joints' turn [rad]", abs(spring - value))
    for key, value in point["link_wrench"].items():
        row = robot.index(f"{key[:4]}.link_{key[-1].lower()}")
        moved = np.linalg.inv(posture.paths[row]).T @ assembly.wrenches[row]
        note("link wrenches [relative]", halves(moved, value))
    for compliant in ("rigid", "free"):
        zone = zone_margin(posture, compliant)
        expected = point[f"t_compliant_{compliant}"]
        note(f"margin, {compliant} [relative]", abs(zone.margin / expected - 1))
    for reading, key in (("frozen", "rigid"), ("free", "free")):
        bounds = bound_pose_error(assembly, reading)
        for letter, bracket in (("R", bounds.rotation_error),
                                ("T", bounds.translation_error)):  # fmt: skip
            low, high = point[f"full_{key}_{letter}"]
            apart = max(0.0, bracket[0] - high, low - bracket[1])
            note(f"brackets of (27) apart, {reading} {letter} [rad, m]", apart)


def main():
    """Compare all points and print."""
    worst = defaultdict(float)
    for case in NUMBERS["cases"]:
        for point in case["points"]:
            compare(case, point, worst)
    print(json.dumps({k: float(f"{v:.2g}") for k, v in worst.items()}, indent=1))


if __name__ == "__main__":
    main()
