"""Campaigns in which a device measures three points of a platform at once.

The repeatability error in each row is a rigid-body motion of the platform.  Each
reading has an additional error of the device.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from forcefit.assembly.files.robot_file import write_robot
from forcefit.assembly.model.robot import Robot
from forcefit.validation.campaign.campaign import Campaign
from forcefit.validation.campaign.campaign_file import read_campaign
from forcefit.validation.synthetic.design import CampaignDesign
from forcefit.validation.synthetic.generator import Noise, Synthetic, generate_campaign
from forcefit.validation.synthetic.machine import Hidden, nominal_pose, with_point

TARGETS = {
    "A": np.array([0.08, 0.0, 0.02]),
    "B": np.array([-0.05, 0.06, 0.02]),
    "C": np.array([0.0, -0.07, 0.03]),
}
DEVICE = 5e-6  # [m] standard deviation of the device error
MACHINE = np.repeat([2e-4, 2e-5], 3)  # [rad, m] repeatability of the machine


def simulated(
    robot: Robot, wanted: Mapping[str, float] | Sequence[tuple[Hidden, float]],
    design: CampaignDesign, seed: int, noise: float,
) -> Synthetic:  # fmt: skip
    """Simulate a machine with effects given as multiples of ``noise`` [m]."""
    size = Noise(rotation=10 * noise, position=noise)
    return generate_campaign(robot, wanted, design, size, seed, "springs")


def write_points(
    made: Synthetic, folder: Path, seed: int, *, common: NDArray = MACHINE,
    device: float = DEVICE, stated: float = DEVICE,
) -> Campaign:  # fmt: skip
    """Write a campaign with simulated readings of three points, and read it.

    Args:
        made: simulated machine with its exact deviations.
        folder: new folder.
        seed: random seed of the noise.
        common: standard deviations (6,) [rad, m] of the platform's repeatability error,
            about the centre of the points in base axes.
        device: standard deviation of the device error [m].
        stated: standard deviation declared in the campaign [m].

    Returns:
        The campaign.
    """
    rng = np.random.default_rng([seed, 33])
    rows, pointed = made.plan.rows, with_point(made.robot, made.reference_point)
    T = np.array([nominal_pose(pointed, row) for row in rows])
    centre = np.mean(list(TARGETS.values()), axis=0)
    motion = common * rng.normal(size=(len(rows), 6))
    turn = Rotation.from_rotvec(made.exact[:, :3])
    read = {}
    for name, target in TARGETS.items():
        arm = T[:, :3, :3] @ (target - made.reference_point)
        deviation = made.exact[:, 3:] + turn.apply(arm) - arm
        from_centre = T[:, :3, :3] @ (target - centre)
        deviation += motion[:, 3:] + np.cross(motion[:, :3], from_centre)
        read[name] = deviation + device * rng.normal(size=(len(rows), 3))
    folder.mkdir(parents=True)
    write_robot(made.robot, folder / "robot.toml")
    points = "".join(f"{n} = {t.tolist()}\n" for n, t in TARGETS.items())
    (folder / "campaign.toml").write_text(
        'robot = "robot.toml"\nmeasurements = "measurements.csv"\n'
        f"reference_point = {made.reference_point.tolist()}\n"
        f"[noise]\nposition = {stated}\n[points]\n{points}"
    )
    covariates = list(rows[0].covariates)
    header = ["id", *made.plan.columns, *(f"load.{a}" for a in _WRENCH)]
    header += [f"meas.{n}.{a}" for n in read for a in ("tx", "ty", "tz")]
    header += [f"cov.{name}" for name in covariates]
    lines = [",".join(header)]
    for i, row in enumerate(rows):
        values = [*made.plan.commands[i], *row.load]
        values += [v for seen in read.values() for v in seen[i]]
        values += [row.covariates[name] for name in covariates]
        lines.append(",".join([f"m{i:03d}", *(f"{v:.12g}" for v in values)]))
    (folder / "measurements.csv").write_text("\n".join(lines) + "\n")
    return read_campaign(folder)


_WRENCH = ("mx", "my", "mz", "fx", "fy", "fz")
