"""Campaigns in which a device reads three points of a platform at once.

Every point moves with the platform as a rigid body: as the machine stands, as the
machine repeats (noise that the points of a row have in common), and on top of that each
reading has noise of the device.
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
DEVICE = 5e-6  # [m] noise of every reading
MACHINE = np.repeat([2e-4, 2e-5], 3)  # [rad, m] by which the machine repeats


def simulated(
    robot: Robot, wanted: Mapping[str, float] | Sequence[tuple[Hidden, float]],
    design: CampaignDesign, seed: int, noise: float,
) -> Synthetic:  # fmt: skip
    """A simulated machine, its effects so many times the noise ``noise`` [m]."""
    size = Noise(rotation=10 * noise, position=noise)
    return generate_campaign(robot, wanted, design, size, seed, "springs")


def write_points(
    made: Synthetic, folder: Path, seed: int, *, common: NDArray = MACHINE,
    device: float = DEVICE, stated: float = DEVICE,
) -> Campaign:  # fmt: skip
    """Write what a device reads of three points, and read the campaign back.

    Args:
        made: the machine, with its exact deviations.
        folder: new.
        seed: of the noise.
        common: (6,) [rad, m] standard deviations of the platform's motion about the
            points' centre, one draw a row; its base axes.
        device: [m] noise of every reading.
        stated: [m] the same as the campaign states it.

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
