"""Robot files with random changes, which are read or rejected.

More changes are tested by ``benchmarks/fuzz.py``.
"""

from contextlib import suppress
from random import Random

import pytest

from benchmarks.fuzz_mutations import change_file
from benchmarks.fuzz_seeds import ARM, BAR
from forcefit.assembly.files.robot_file import read_robot
from forcefit.assembly.kinematics.posture import home_posture, place_robot
from forcefit.inputs.table import BadInput
from tests.robot_files_for_tests import rows

STEEL = "young = 2.1e11, poisson = 0.3 }"
BODIES = (
    f'{{ beam = {{ radius = 0.02, inner_radius = 0.01, theory = "euler" }}, {STEEL}',
    f"{{ beam = {{ width = 0.02, height = 0.04, up = [0, 0, 1] }}, {STEEL}",
    "{ beam = { area = 1e-4, I_y = 1e-8, I_z = 2e-8, J = 3e-8, shear_y = 0.8, "
    f"shear_z = 0.9, length = 0.3, axis = [1, 0, 0] }}, {STEEL}",
    f"{{ stiffness = {rows({})} }}",
    '{ library = "links.nc#upper" }',
    '{ mesh = { surface = "meshes/x.stl", base = "z=0", up = [1, 0, 0], tip = { bore '
    f"= {{ point = [0, 0, 0.4], axis = [0, 1, 0], radius = 0.01 }} }} }}, {STEEL}\n"
    "up = [0, 0, 1]",
)
LINKS = 'name = "links"\nplatform = "f5"\n' + "".join(
    f'[[frame]]\nname = "f{i}"\nparent = "{f"f{i - 1}" if i else "base"}"\n'
    f"translation = [0.1, 0.2, 0.0]\nlink = {link}\n"
    for i, link in enumerate(BODIES)
)
SEEDS = {"four_bar": BAR, "serial": ARM, "links": LINKS}


@pytest.mark.parametrize("name", SEEDS)
def test_loops_of_unchanged_robot_files_are_closed(name, write_file):
    """The unchanged files are valid."""
    assert home_posture(read_robot(write_file(SEEDS[name]))).mismatch < 1e-9


@pytest.mark.parametrize("name", SEEDS)
def test_damaged_robot_file_is_read_or_rejected(name, write_file):
    """Values, keys, tables, lines or bytes are changed at random with fixed seeds."""
    for seed in range(100):
        path = write_file(SEEDS[name])
        change_file(path, Random(f"{name} {seed}"))
        try:
            robot = read_robot(path)
            home_posture(robot)
        except BadInput as error:
            told = str(error)
            assert told.startswith(f"{path}: "), seed
            assert all(c >= " " for c in told), seed
            assert len(told) <= 800, seed
            continue
        with suppress(BadInput):  # the pose may be outside the workspace
            place_robot(robot, pose={"tx": 0.4, "rz": 0.1})
