"""Compute the accuracy of a hexapod for two clearances of its ball joints.

Run ``python examples/hexapod_accuracy.py``, which takes some minutes.  The sweep covers
a square of 100 mm at working height.  At every posture it draws the errors of
``hexapod_errors.toml`` and bounds the pose error due to errors and clearances, problem
(27).  For clearances of 8 and 4 micrometres it prints the 90 % quantile of the pose
error, in the middle of the square and at the worst posture.  It also prints the error
due to clearances alone, and the distance from a singularity.

The equivalent command, with two processes:

    forcefit assembly sweep hexapod --errors examples/hexapod_errors.toml --draws 10 \\
        --grid "tx=-0.05:0.05:0.025,ty=-0.05:0.05:0.025,tz=0.53,rx=0,ry=0,rz=0" \\
        --vary ball_3.clearance.axial=8e-6,4e-6 --workers 2 \\
        --quantities default,rotation_error_clearance,translation_error_clearance \\
        -o hexapod.nc --figure hexapod.png
"""

import argparse
from pathlib import Path

import forcefit as ff

HERE = Path(__file__).parent
CLEARANCE = "ball_3.clearance.axial"


def main():
    """Run the sweep, draw the figure and print the errors."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--draws", type=int, default=10, help="number of machines")
    parser.add_argument("--step", type=float, default=0.025, help="grid spacing [m]")
    parser.add_argument("-o", "--output", type=Path, default=Path("hexapod.nc"))
    options = parser.parse_args()
    square = ",".join(f"{axis}=-0.05:0.05:{options.step}" for axis in ("tx", "ty"))
    data = ff.sweep(
        "hexapod",
        grid=f"{square},tz=0.53,rx=0,ry=0,rz=0",
        vary=[f"{CLEARANCE}=8e-6,4e-6"],
        errors=HERE / "hexapod_errors.toml",
        draws=options.draws,
        quantities=[
            "default",
            "rotation_error_clearance",
            "translation_error_clearance",
        ],
        output=options.output,
    ).squeeze()
    for place, part in data.groupby(CLEARANCE):
        print_errors(float(place), part.squeeze())
    near = data["singular_distance"].min(["tx", "ty", "draw", CLEARANCE])
    distances = ", ".join(
        f"{k} {float(near.sel(kind=k)):.2f}" for k in near.kind.values
    )
    print(f"smallest distances to singularities in the square: {distances}")
    figure = ff.show(data, at={CLEARANCE: 8e-6})
    figure.savefig(options.output.with_suffix(".png"), dpi=150)


def print_errors(clearance, data):
    """Print the errors in the middle and at the worst posture for one clearance."""
    upper = data.sel(bound="upper")
    print(
        f"ball joints with {clearance * 1e6:.0f} um of clearance, "
        f"{data.sizes['draw']} machines:"
    )
    for part, factor, unit in (("translation", 1e6, "um"), ("rotation", 1e6, "urad")):
        share = factor * upper[f"{part}_error"].quantile(0.9, "draw")
        alone = factor * upper[f"{part}_error_clearance"].isel(draw=0)
        middle = share.sel(tx=0, ty=0, method="nearest")
        print(f"  {part:11s} 90 % below {float(middle):.0f} {unit} in the middle, "
              f"{float(share.max()):.0f} {unit} at the worst posture; "
              f"by clearances alone {float(alone.max()):.0f} {unit}")  # fmt: skip


if __name__ == "__main__":
    main()
