"""Measurement campaigns shared by several tests, in folders and in memory."""

import csv

import numpy as np

from forcefit.assembly.kinematics.posture import home_posture
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


def table_rows(numbers, first=0):
    """Lines of a measuring table with the ids m0, m1, ... for numbers (R, n)."""
    rows = enumerate(np.asarray(numbers).tolist(), first)
    return [",".join([f"m{i}", *map(repr, row)]) for i, row in rows]


def read_table(path):
    """Rows of a CSV file as dictionaries."""
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def fitted_numbers(effects, name, session=None):
    """Values and standard deviations of an effect in the table of a diagnosis."""
    return {
        p["name"]: (p["value"], p["std"])
        for effect in effects
        if effect["name"] == name and effect.get("session") == session
        for p in effect["parameters"]
    }


def campaign_at(robot, placed, measured, sigma, **given):
    """A campaign of readings (R, 6) at the postures of the rows, with other fields."""
    rows = len(placed)
    return Campaign(**{
        "name": robot.name, "robot": robot, "ids": tuple(f"m{i}" for i in range(rows)),
        "coordinates": np.stack([p.coordinates for p in placed]),
        "transforms": np.stack([p.transforms for p in placed]),
        "mismatch": np.zeros(rows), "commanded": "joints", "measured": measured,
        "loads": np.zeros((rows, 6)), "sigma": np.broadcast_to(sigma, (rows, 6)),
        "covariates": {}, "reference_point": np.zeros(3), "registration": "known",
        "configuration": np.arange(rows), "repeat": np.arange(rows),
    } | given)  # fmt: skip


def campaign_of(measured, sigma=1.0, repeat=None, loads=None, **covariates):
    """Return a campaign with given readings (R, 6).

    Rows with equal ``repeat`` have the same configuration.
    """
    rows = len(measured)
    robot = Robot("post", "top", (Frame("top", translation=[0, 0, 1.0]),))
    repeat = np.arange(rows) if repeat is None else np.asarray(repeat)
    return campaign_at(
        robot, [home_posture(robot)] * rows, measured, sigma, configuration=repeat,
        loads=np.zeros((rows, 6)) if loads is None else loads, repeat=repeat,
        covariates=covariates,
    )  # fmt: skip
