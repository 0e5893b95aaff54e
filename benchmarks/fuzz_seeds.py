"""Valid files of all kinds, and commands that read them, for ``fuzz.py``."""

from pathlib import Path

import numpy as np

from tests.robot_files_for_tests import FOUR_BAR

# parallelogram linkage of the tests with geometric errors
BAR = FOUR_BAR.replace(
    "mass = 1.2", "mass = 1.2\ngeometric_error = [1e-4, 1e-4, 1e-4, 1e-5, 1e-5, 1e-5]"
)
ARM = """
name = "arm"
platform = "tool"
[[frame]]
name = "one"
parent = "base"
joint = "revolute"
actuated = true
joint_stiffness = [1e8, 1e8, 1e5, 3.5e8, 3.5e8, 4.4e8]
[[frame]]
name = "two"
parent = "one"
dh = { theta = 0.1, d = 0.2, a = 1.0, alpha = 1.5 }
joint = "prismatic"
actuated = true
position = 0.5
mass = 2.0
centre_of_mass = [0, 0, 0.1]
[[frame]]
name = "tool"
parent = "two"
translation = [0.3, 0, 0]
link = { library = "links#round-beam-length0.3-radius0.02-young7e+10-poisson0.3" }
"""
EFFECTS = """
[[effect]]
name = "drive_compliance"
parameters = { one = 5e4 }
[[effect]]
name = "drift"
parameters = { "amplitude.tz" = 1e-5, time_constant = 600 }
"""
ERRORS = """
[[errors]]
frames = ["elbow", "wrist"]
distribution = "uniform"
most = [1e-4, 1e-4, 1e-4, 1e-5, 1e-5, 1e-5]
[[errors]]
frames = ["coupler"]
distribution = "normal"
deviation = [1e-4, 1e-4, 1e-4, 1e-5, 1e-5, 1e-5]
"""
PLAN = """
yield = 0.9
cost = "reciprocal"
draws = 50
seed = 3
[limits]
energy = 5.0
[[tolerance]]
name = "length"
frames = ["elbow", "wrist"]
components = ["TX"]
cost = 2.0
least = 1e-7
most = 1e-3
"""
STUDY = """
title = "a study"
robot = "bar.toml"
output = "out"
grid = "tx=0.65:0.66:0.01"

[errors]
frames = ["elbow"]
least = [0, 0, 0, 0, 0, 0]
most = [1e-4, 1e-4, 1e-4, 1e-5, 1e-5, 1e-5]
seed = 1
"""
SPEC = """
library = "built"
shape = "round"
method = "beam"
accuracy = 0.005
[grid]
length = [0.2, 0.3]
radius = 0.02
young = 7e10
poisson = 0.3
"""
CURVE = """
[[piece]]
section = { radius = 0.02 }
end = [0.3, 0, 0]
tip_section = { radius = 0.01 }
[[piece]]
section = { width = 0.02, height = 0.03 }
up = [0, 0, 1]
end = [0.3, 0.2, 0]
"""
CAMPAIGN = """
robot = "robot.toml"
measurements = "measurements.csv"
reference_point = [0, 0, 0]
registration = "known"
[noise]
rotation = 1e-5
position = 5e-6
[table]
delimiter = ","
[units]
position = "m"
"""
MEASURED = """
name = "measured"
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
POSES = "id,q.crank\na,1\nb,1.1\nc,1.2\n"
WAY = "id,time,q.crank\na,0,1\nb,0.1,1.1\nc,0.25,1.2\n"
OBJECT = """
v 0 0 0
v 1 0 0
v 0 1 0
v 0 0 1
f 1 3 2
f 1 2 4
f 2 3 4
f 1 4 3
"""

# relative frequency and arguments of each command; output files start with "new"
COMMANDS = [
    (9, "assembly solve bar.toml --quantities margin"),
    (9, "assembly solve bar.toml --load fx=10,mz=1 --gravity y=-9.81 --json -"),
    (6, "assembly solve arm.toml --joint one=0.2,two=0.4 --under time=60 --json "
        "new.json"),
    (3, "assembly solve bar.toml --state exact --joint crank=1.1"),
    (3, "assembly error bar.toml --assumption frozen --at x=0.1 --along tx=1"),
    (1, "assembly show bar.toml --figure new.png --exaggeration 20"),
    (5, "assembly sweep bar.toml --grid q.crank=1:1.2:0.1 -o new.nc --near 0.1"),
    (5, "assembly sweep bar.toml --poses poses.csv -o new.nc --assumption none "
        "--wrench-of elbow"),
    (4, "assembly sweep bar.toml --grid q.crank=1:1.1:0.1 -o new.nc --errors "
        "errors.toml --draws 3 --seed 2 --assumption none --vary "
        "coupler.link.young=7e10,2e11"),
    (1, "assembly sweep bar.toml --grid q.crank=1:1.2:0.1 -o new.nc --figure new.svg "
        "--yield-strength 2e8 --assumption none"),
    (6, "assembly sweep bar.toml --grid q.crank=1:1.2:0.1 -o kept.nc --near 0.1"),
    (6, "assembly statistics bar.toml --errors errors.toml --draws 40 --seed 2 --limit "
        "energy=5 --confidence 0.9 -o new.nc --json new.json"),
    (2, "assembly statistics bar.toml --errors errors.toml --draws 40 -o drawn.nc"),
    (3, "assembly tolerances bar.toml --grid tx=0.65 --plan plan.toml --draws 20 "
        "-o new.nc --json -"),
    (2, "assembly tolerances bar.toml --grid tx=0.65:0.66:0.01 --quantities margin"),
    (5, "assembly path bar.toml --path way.csv --gravity y=-9.81 --points 9 -o new.nc "
        "--json -"),
    (4, "assembly path bar.toml --path poses.csv --profile quintic --speed 0.5 "
        "--acceleration 2 --points 9 --figure new.svg --report new.html"),
    (2, "assembly plot swept.nc --figure new.svg"),
    (1, "assembly plot draws.nc --figure new.png --kind histogram"),
    (5, "stiffness beam --length 0.4 --young 2.1e11 --poisson 0.3 --radius 0.02 "
        "--along 1,0,2 --theory timoshenko --json -"),
    (4, "stiffness beam --length 0.4 --young 2.1e11 --poisson 0.3 --section "
        "width=0.06,height=0.04,wall=0.003 --up z"),
    (7, "stiffness beam curve.toml --young 7e10 --poisson 0.3 --json new.json"),
    (3, "stiffness fea solid.obj --base z=0 --tip z=7 --young 7e10 --poisson 0.3 "
        "--unit mm --part z=0.2..0.4/young=2e11,poisson=0.3,density=7800 --mass "
        "1/0,0,1"),
    (3, "stiffness fea solid.stl --base z=0 --tip bore=0,0,0/0,1,0/7 --young 7e10 "
        "--poisson 0.3 --accuracy 0.1"),
    (2, "stiffness compare solid.obj --base z=0 --tip z=7 --young 7e10 --poisson 0.3 "
        "--radius 0.02 --figure new.pdf"),
    (2, "stiffness stress solid.obj --base z=0 --tip z=7 --young 7e10 --poisson 0.3 "
        "--load fx=10,mz=1 --away 0.01"),
    (1, "stiffness compare --young 7e10 --poisson 0.3 --radius 0.02 --ratios 5,x"),
    (6, "stiffness library spec.toml --workers 1"),
    (5, "stiffness library links"),
    (4, "stiffness library links --at length=0.3 --json -"),
    (4, "stiffness library links --to csv"),
    (3, "stiffness library links --to mapdl --key "
        "round-beam-length0.3-radius0.02-young7e+10-poisson0.3"),
    (6, "validation inspect campaign --json -"),
    (1, "validation diagnose campaign --json new.json --save new.toml --report "
        "new.html"),
    (1, "validation crosscheck bar.toml --scale 1,x --links beam --time-limit 5"),
    (3, "validation validity bar.toml --joint crank=1.1 --load fx=10"),
    (2, "validation generate arm.toml newfolder --truth new.json --effect drift=3 "
        "--configurations 2 --rows 4 --program springs"),
    (6, "study study.toml -o newstudy"),
]  # fmt: skip


def write_seeds(folder: Path) -> None:
    """Write all input files that are not written by commands.

    Args:
        folder: empty folder.
    """
    texts = {
        "bar.toml": BAR, "arm.toml": ARM + EFFECTS, "errors.toml": ERRORS,
        "plan.toml": PLAN, "study.toml": STUDY, "spec.toml": SPEC,
        "curve.toml": CURVE, "poses.csv": POSES, "solid.obj": OBJECT, "way.csv": WAY,
        "campaign/campaign.toml": CAMPAIGN, "campaign/robot.toml": MEASURED,
        "campaign/measurements.csv": _measurements(), "notes.txt": "mine\n",
        "links.toml": SPEC.replace('"built"', '"links"'),
    }  # fmt: skip
    (folder / "campaign").mkdir()
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")
    (folder / "solid.stl").write_bytes(_stl())


def _measurements() -> str:
    """Return eight simulated measurements of an arm as CSV text."""
    rng = np.random.default_rng(4)
    lines = ["id,q.one,q.two,load.fx,meas.tx,meas.ty,meas.tz,cov.temperature,cov.time"]
    for i in range(8):
        drives = rng.uniform(-1, 1, 2)
        read = rng.normal(0, 5e-6, 3)
        cells = [*drives, 10.0 * (i % 2), *read, 20 + 0.5 * i, 60 * i]
        lines.append(",".join([f"m{i}", *(f"{x:.6g}" for x in cells)]))
    return "\n".join(lines) + "\n"


def _stl() -> bytes:
    """Return a tetrahedron as a binary STL file."""
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    faces = corners[[[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]]
    record = np.zeros(4, dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)),
                                ("attribute", "<u2")])  # fmt: skip
    record["corners"] = faces
    return bytes(80) + np.uint32(4).tobytes() + record.tobytes()


# commands whose output files are read by other commands
MADE = [
    "stiffness library links.toml",
    "assembly sweep bar.toml --grid q.crank=1:1.2:0.1 -o swept.nc --near 0.1",
    "assembly statistics bar.toml --errors errors.toml --draws 40 -o draws.nc",
]
# commands that are killed before their output is written, so that journals remain
KILLED = [
    "assembly sweep bar.toml --grid q.crank=1:1.2:0.1 -o kept.nc --near 0.1",
    "assembly statistics bar.toml --errors errors.toml --draws 40 -o drawn.nc",
]
