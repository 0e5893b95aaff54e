"""Two valid robot files, and parts of them that tests replace."""

import re

import pytest

from forcefit.assembly.files.robot_file import read_robot
from forcefit.inputs.table import BadInput

FOUR_BAR = """
name = "four_bar"
description = "a parallelogram"
platform = "coupler"

[[frame]]
name = "crank"
parent = "base"
joint = "revolute"
actuated = true
position = 1.0

[[frame]]
name = "elbow"
parent = "crank"
translation = [0.3, 0, 0]
joint = "revolute"
position = -1.0
clearance = { radial = 29e-6, spin = 3.0 }

[[frame]]
name = "coupler"
parent = "elbow"
translation = [0.5, 0.0, 0.0]
link = { beam = { radius = 0.04, inner_radius = 0.03 }, young = 6e10, poisson = 0.3 }
mass = 1.2

[[frame]]
name = "rocker"
parent = "base"
translation = [0.5, 0.0, 0.0]
joint = "revolute"
position = 1.0
joint_stiffness = [1e8, 1e8, 1.0, 3e8, 3e8, inf]

[[frame]]
name = "wrist"
parent = "rocker"
translation = [0.3, 0.0, 0.0]
joint = "revolute"
position = -1.0

[[frame]]
name = "seat"
parent = "wrist"

[[closure]]
frames = ["coupler", "seat"]
"""


SLIDER = """
name = "slider"
platform = "tool"
[[frame]]
name = "slide"
parent = "base"
joint = "prismatic"
actuated = true
position = 0.2
[[frame]]
name = "tool"
parent = "slide"
translation = [0.3, 0.0, 0.2]
rotation = [0.0, 1.5707963267948966, 0.0]
link = { beam = { radius = 0.01 }, young = 7e10, poisson = 0.3 }
"""


BEAM = "beam = { radius = 0.04, inner_radius = 0.03 }"


LINK = f"link = {{ {BEAM}, young = 6e10, poisson = 0.3 }}"


SPRING = "joint_stiffness = [1e8, 1e8, 1.0, 3e8, 3e8, inf]"


PLAY = "clearance = { radial = 29e-6, spin = 3.0 }"


def mesh(surface="x.stl", tip='"z=0.5"', more=""):
    """Format the key ``mesh`` in TOML."""
    return f'mesh = {{ surface = "{surface}", base = "z=0", tip = {tip}{more} }}'


def rows(changes):
    """Format a unit matrix (6, 6) with some entries (counted from 1) replaced."""
    K = [[changes.get((i, j), float(i == j)) for j in range(1, 7)] for i in range(1, 7)]
    return str(K)


def assert_refused(write_file, old, new, message):
    """Check that the valid file with one change is rejected with a one-line message."""
    assert FOUR_BAR.count(old) >= 1, "the text to replace is not in the file"
    path = write_file(FOUR_BAR.replace(old, new))
    with pytest.raises(BadInput, match=re.escape(f"{path}: {message}")) as caught:
        read_robot(path)
    assert "\n" not in str(caught.value)
