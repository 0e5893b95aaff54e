"""Draw figure 5 of the paper for positive errors and for errors of random signs.

Run ``python examples/paper_figure5.py``; with ``--step 0.05`` it takes a quarter of the
time.  For each sign convention it writes a robot file with the drawn errors, the data
set of the maps and the figure.  It prints the smallest, median and largest value of
each map and of a reference from another program.  The positive errors are the same in
the reference, but the random signs differ.  To draw the figure again without solving,
run ``forcefit assembly plot figure5_literal.nc --figure figure5_literal.png``.
"""

import argparse
from pathlib import Path

import numpy as np

import forcefit as ff
from forcefit.assembly.files.robot_file import write_robot
from forcefit.assembly.linear.zone import ASSEMBLABLE
from forcefit.assembly.model.random_errors import (
    SIGNS,
    ErrorDraw,
    draw_errors,
    frames_named,
)
from forcefit.assembly.robots import load_robot

FRAMES = ["elbow_a", "link_a", "elbow_b", "link_b", "loop2_platform", "tip"]
LEAST = (1e-4, 1e-4, 1e-4, 1e-6, 1e-6, 1e-6)  # [rad, m] from section IV of the paper
MOST = (2e-2, 2e-2, 2e-2, 2e-4, 2e-4, 2e-4)
# variable, factor, unit, reference for positive errors, reference for random signs
ROWS = (
    ("margin_free", 1, "-", (0.060, 2.76, 5.37), (0.071, 5.32, 8.66)),
    ("margin", 1, "-", (13.2, 18.8, 22.8), (17.7, 20.7, 24.1)),
    ("energy", 1, "J", (1.1e-3, 3.36, 14.7), (3.2e-3, 17.3, 67.1)),
    ("rotation_error", 1e3, "mrad", (8.6, 12.7, 27.7), (24.5, 38.0, 66.3)),
    ("translation_error", 1e3, "mm", (0.235, 0.823, 2.60), (0.49, 2.24, 7.76)),
    ("rotation_error_clearance", 1e3, "mrad", (1.53, 1.74, 3.54), (1.53, 1.74, 3.54)),
    (
        "translation_error_clearance",
        1e3,
        "mm",
        (0.293, 0.332, 0.732),
        (0.293, 0.332, 0.732),
    ),
)


def main():
    """Run the sweep, draw the figures and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--step", type=float, default=0.025, help="grid spacing [m]")
    parser.add_argument("-o", "--output", type=Path, default=Path("."))
    options = parser.parse_args()
    step = options.step
    x, z = (step * np.floor(end / step + 1e-9) for end in (0.65, 0.75))
    grid = f"tx={-x:.9g}:{x:.9g}:{step},tz={-z:.9g}:0:{step}"
    robot = load_robot("irsbot2")
    frames = frames_named(robot, FRAMES)
    for column, signs in enumerate(SIGNS):
        base = options.output / f"figure5_{signs}"
        errors = draw_errors(robot, ErrorDraw(frames, LEAST, MOST, 1, signs))
        write_robot(robot.with_errors(errors), base.with_suffix(".toml"))
        data = ff.sweep(
            base.with_suffix(".toml"), grid=grid,
            quantities=[
                "default", "rotation_error_clearance", "translation_error_clearance"
            ],
            output=base.with_suffix(".nc"),
        )  # fmt: skip
        ff.show(data).savefig(base.with_suffix(".png"), dpi=150)
        print_table(signs, data, column)


def print_table(signs, data, column):
    """Print the smallest, median and largest value of each map and its reference."""
    reached = data["status"] == "ok"
    inside = (data["margin_free"] <= ASSEMBLABLE).sum() / reached.sum()
    print(f"{signs}: {int(reached.sum())} postures, {100 * float(inside):.1f} % "
          "assemble by clearances with compliant joints free")  # fmt: skip
    for name, factor, unit, *reference in ROWS:
        values = data[name]
        if "bound" in values.dims:
            values = values.sel(bound="upper")
        values = factor * values.values[np.isfinite(values.values)]
        found = (values.min(), np.median(values), values.max())
        shown = " / ".join(f"{v:.3g}" for v in found)
        expected = " / ".join(f"{v:.3g}" for v in reference[column])
        print(f"  {name + ' [' + unit + ']':32s} {shown:24s} reference {expected}")


if __name__ == "__main__":
    main()
