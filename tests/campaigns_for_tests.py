"""Measurement campaigns shared by several tests, in folders and in memory."""

import numpy as np

from forcefit.assembly.model.robot import Frame, Robot
from forcefit.validation.campaign.campaign import Campaign

ARM = """
name = "arm"
platform = "tool"
[[frame]]
name = "one"
parent = "base"
joint = "revolute"
actuated = true
[[frame]]
name = "two"
parent = "one"
translation = [1.0, 0, 0]
joint = "revolute"
actuated = true
position = 0.5
[[frame]]
name = "tool"
parent = "two"
translation = [0.8, 0, 0]
"""
HEAD = (
    "id,q.one,q.two,load.fx,load.mx,meas.tx,meas.ty,meas.tz,"
    "cov.temperature,cov.time,cov.approach"
)
ROWS = [
    "m1,0.1,0.2,0,0,1e-05,2e-05,3e-05,1.5,0,1",
    "m2,0.3,0.4,10,0,2e-05,,0,2,60,-1",
    "m3,0.1,0.2,-0.0,0,1.1e-05,2.1e-05,3.1e-05,1,120,1",
    "m4,0.1,0.2,10,0,1e-05,2e-05,3e-05,1,180,1",
]
NOISE = "[noise]\nrotation = 1e-5\nposition = 5e-6\n"


def write_campaign(folder, head=HEAD, rows=ROWS, robot=ARM, toml=None, noise=NOISE,
                   extra=""):  # fmt: skip
    """Write campaign.toml, measurements.csv and robot.toml, and return the folder.

    Args:
        folder: folder to write.
        head: header line of the measurements.
        rows: lines of the measurements.
        robot: text of the robot file.
        toml: values that replace those of the campaign file; None omits a key.
        noise: text of the ``[noise]`` table.
        extra: text at the end of the campaign file.
    """
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "robot.toml").write_text(robot)
    lines = [] if head is None else [head]
    (folder / "measurements.csv").write_text("".join(f"{r}\n" for r in lines + rows))
    keys = {"robot": '"robot.toml"', "measurements": '"measurements.csv"'}
    keys |= toml or {}
    text = "".join(f"{k} = {v}\n" for k, v in keys.items() if v is not None)
    (folder / "campaign.toml").write_text(text + noise + extra)
    return folder


def campaign_of(measured, sigma=1.0, repeat=None, loads=None, **covariates):
    """Return a campaign with given readings (R, 6).

    Rows with equal ``repeat`` have the same configuration.
    """
    rows = len(measured)
    robot = Robot("post", "top", (Frame("top", translation=[0, 0, 1.0]),))
    repeat = np.arange(rows) if repeat is None else np.asarray(repeat)
    return Campaign(
        name="made up",
        robot=robot,
        ids=tuple(f"m{i}" for i in range(rows)),
        coordinates=np.zeros((rows, 1)),
        transforms=np.broadcast_to(robot.fixed_transforms, (rows, 1, 4, 4)),
        mismatch=np.zeros(rows),
        commanded="joints",
        loads=np.zeros((rows, 6)) if loads is None else loads,
        measured=measured,
        sigma=np.broadcast_to(sigma, (rows, 6)),
        covariates=covariates,
        reference_point=np.zeros(3),
        registration="known",
        configuration=repeat,
        repeat=repeat,
    )
