"""Study of the paper on a 25 mm grid of the half workspace.

The reference gives smallest, median and largest values to two or three digits.  The
tolerance is one unit of the last digit.
"""

import numpy as np
import pytest

from forcefit.assembly.kinematics.posture import place_many
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.assembly.linear.pose_error import bound_pose_error
from forcefit.assembly.robots.irsbot2 import irsbot2
from forcefit.assembly.sweeps.sweep import assemblable, sweep_poses
from forcefit.assembly.sweeps.targets import parse_grid
from tests.robots_for_tests import NUMBERS, irsbot2_with

GRID = "tx=-0.8:0.8:0.025,tz=-0.8:0:0.025"
TABLE = {  # free margin, fraction assemblable [%], rigid margin, energy [J]
    "literal": (
        [(0.060, 1e-3), (2.76, 1e-2), (5.37, 1e-2)], 15.9,
        [(13.2, 0.1), (18.8, 0.1), (22.8, 0.1)],
        [(1.1e-3, 1e-4), (3.36, 1e-2), (14.7, 0.1)],
    ),
    "signed": (
        [(0.071, 1e-3), (5.32, 1e-2), (8.66, 1e-2)], 3.1,
        [(17.7, 0.1), (20.7, 0.1), (24.1, 0.1)],
        [(3.2e-3, 1e-4), (17.3, 0.1), (67.1, 0.1)],
    ),
}  # fmt: skip
FROZEN = {  # [mrad], [mm]
    "literal": ([(8.6, 0.1), (12.7, 0.1), (27.7, 0.1)],
                [(0.235, 1e-3), (0.823, 1e-3), (2.60, 1e-2)]),
    "signed": ([(24.5, 0.1), (38.0, 0.1), (66.3, 0.1)],
               [(0.49, 1e-2), (2.24, 1e-2), (7.76, 1e-2)]),
}  # fmt: skip


def spread(values):
    values = values[np.isfinite(values)]
    return values.min(), np.median(values), values.max()


def assert_as_printed(values, printed):
    for found, (expected, unit) in zip(spread(values), printed, strict=True):
        assert found == pytest.approx(expected, abs=unit), spread(values)


@pytest.mark.slow
@pytest.mark.parametrize("case", NUMBERS["cases"], ids=lambda c: c["name"])
def test_maps_agree_with_the_reference(case):
    data = sweep_poses(irsbot2_with(case), parse_grid(GRID))
    # The paper also includes points beyond singularities.
    reached = np.isin(data.status.values, ["ok", "beyond_singularity"])
    assert reached.sum() == 1113
    free, share, rigid, energy = TABLE[case["name"]]
    assert_as_printed(data.margin_free.values, free)
    assert_as_printed(data.margin.values, rigid)
    assert_as_printed(data.energy.values, energy)
    inside = 100 * assemblable(data).sum() / reached.sum()
    assert inside == pytest.approx(share, abs=0.1)
    # All points are certified.
    floor = 1e-8 * data.energy.values[reached]
    assert np.all(data.duality_gap.values[reached] <= floor + 1e-10)
    assert data.closure_residual.max() < 1e-11
    assert data.clearance_excess.max() < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("case", NUMBERS["cases"], ids=lambda c: c["name"])
def test_pose_errors_agree_with_the_reference(case):
    x, z = np.meshgrid(*parse_grid(GRID).values(), indexing="ij")
    poses = np.full((x.size, 6), np.nan)
    poses[:, 0], poses[:, 2] = x.ravel(), z.ravel()
    postures, _ = place_many(irsbot2_with(case), poses)
    found = [
        bound_pose_error(solve_assembly(p), "frozen") for p in postures if p is not None
    ]
    assert len(found) == 1113
    rotation = np.array([f.rotation_error for f in found])
    translation = np.array([f.translation_error for f in found])
    assert np.ptp(rotation, axis=1).max() <= 1e-6
    assert np.ptp(translation, axis=1).max() <= 1e-6
    printed = FROZEN[case["name"]]
    assert_as_printed(1e3 * rotation[:, 1], printed[0])
    assert_as_printed(1e3 * translation[:, 1], printed[1])


@pytest.mark.slow
def test_pose_errors_due_to_clearances_are_within_reference_range():
    """The grid has a spacing of 100 mm."""
    x, z = np.meshgrid(np.arange(0, 0.61, 0.1), np.arange(-0.7, -0.05, 0.1))
    poses = np.full((x.size, 6), np.nan)
    poses[:, 0], poses[:, 2] = x.ravel(), z.ravel()
    postures, _ = place_many(irsbot2(), poses)
    for reading, rotation, translation in (
        ("frozen", (1.53e-3, 3.54e-3), (0.293e-3, 0.732e-3)),
        ("free", (2.52e-3, 8.18e-3), (0.297e-3, 1.02e-3)),
    ):
        for posture in filter(None, postures):
            found = bound_pose_error(solve_assembly(posture), reading)
            assert rotation[0] - 5e-6 <= found.rotation_error[1]
            assert found.rotation_error[0] <= rotation[1] + 5e-6
            assert translation[0] - 5e-7 <= found.translation_error[1]
            assert found.translation_error[0] <= translation[1] + 5e-6
