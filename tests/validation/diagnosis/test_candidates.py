"""Test candidate functions and the variables on which they can depend."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit.assembly.effects.functions import AXES
from forcefit.assembly.model.robot import Frame, Robot
from forcefit.validation.campaign.campaign_file import read_commands
from forcefit.validation.diagnosis.candidates import (
    Candidate,
    CandidatePart,
    variables_of,
)
from forcefit.validation.diagnosis.function_forms import CandidateShape
from forcefit.validation.diagnosis.responses import responses
from forcefit.validation.diagnosis.sensitivities import Sensitivities
from forcefit.validation.diagnosis.signatures import conditions_of
from tests.bar_for_tests import BEAM, LENGTH, along, bar
from tests.campaigns_for_tests import table_rows

LINE = CandidateShape("powers", ("0", "1"))


def one_at(components):
    part = CandidatePart("reading", components, "q.drive")
    return Candidate((part,), "screw", LINE)


def test_fitted_function_omits_components_without_influence():
    """The names of its parameters have no prefix if one component remains."""
    conditions = conditions_of(bar())
    s = Sensitivities(conditions, responses(conditions))
    _, mixed = s.basis(("q.drive",), LINE)
    x = np.array([1e-12, 0.0, 1e-3, 2e-3])
    (function,) = s.fitted(one_at(("tx", "rz")), x, np.full(4, 1e-4))
    assert function.components == ("rz",)
    values = dict(zip("01", mixed @ x[2:], strict=True))
    assert function.parameters == pytest.approx(values | {"0": values["0"]})
    assert set(function.std) == {"0", "1"}
    (whole,) = s.fitted(one_at(("rz",)), x[2:], np.full(2, 1e-4))
    assert whole.parameters == pytest.approx(values)
    assert s.fitted(one_at(("tx", "rz")), np.zeros(4), np.full(4, 1e-4)) == []


@pytest.mark.parametrize("axis", range(6))
def test_sensitivities_agree_with_hand_calculation(axis):
    """The locations are the base, the reading and the drive of a loaded bar."""
    campaign = bar([0.3, -0.2, 3.0, 1.0, 5.0, -2.0], link=BEAM)
    conditions = conditions_of(campaign)
    response = responses(conditions)
    s = Sensitivities(conditions, response)
    place, name = LENGTH * along(campaign), AXES[axis]
    unit = np.tile(np.eye(6)[axis], (8, 1))
    unit[:, 3:] += np.cross(unit[:, :3], place)
    np.testing.assert_allclose(s.sensitivity("base", name, "screw"), unit, atol=1e-8)
    read = s.sensitivity("reading", name, "screw")
    assert read.tolist() == np.tile(np.eye(6)[axis], (8, 1)).tolist()
    # The drive frame coincides with the base frame.
    np.testing.assert_allclose(s.sensitivity("drive", name, "screw"), unit, atol=1e-8)
    load = np.tile(campaign.loads[0], (8, 1))
    load[:, :3] += np.cross(place, load[:, 3:])
    soft = s.sensitivity("drive", name, "compliance")
    np.testing.assert_allclose(soft, load[:, axis, None] * unit, atol=1e-7)


def test_constant_or_incomplete_quantities_are_not_variables():
    """A function can depend only on quantities that vary and are always known."""
    varying = np.linspace(-1.0, 0.5, 8)
    lacking = np.where(np.arange(8) == 3, np.nan, varying)
    conditions = conditions_of(bar(
        [0, 0, 2.0, 0, 0, 0], time=np.zeros(8), approach=np.tile([-1.0, 1.0], 4),
        speed=np.full(8, 7.0), dust=1e-9 * varying,
    ))  # fmt: skip
    found = variables_of(replace(conditions, temperature=lacking))
    assert found == ["q.drive", "position.x", "position.y", "approach", "cov.dust"]
    loads = np.zeros((8, 6))
    loads[:, 4] = varying
    campaign = replace(bar(temperature=varying, time=60.0 * np.arange(8)), loads=loads)
    assert variables_of(conditions_of(campaign)) == [
        "q.drive", "load.fy", "load.force", "position.x", "position.y",
        "cov.temperature", "time",
    ]  # fmt: skip


def test_quantities_that_vary_only_by_round_off_are_not_variables(tmp_path):
    """The slide is rotated by pi/2, whose cosine is 6e-17 in floating point."""
    turn = [0, np.pi / 2, 0]
    robot = Robot("axis", "carriage", (
        Frame("x", rotation=turn, joint="prismatic", actuated=True),
        Frame("carriage", "x", rotation=np.negative(turn)),
    ))  # fmt: skip
    x = np.linspace(0.0, 0.5, 9).round(3)
    rows = table_rows(np.outer(x, [1.0, 5.0, 1e-17]))
    table = tmp_path / "commands.csv"
    table.write_text("\n".join(["id,q.x,load.fx,load.fy", *rows]) + "\n")
    campaign = read_commands(table, robot)
    conditions = conditions_of(campaign)
    assert np.ptp(conditions.postures.platform[:, 2, 3]) > 0.0
    found = variables_of(conditions)
    assert {n for n in found if n[:4] in {"q.x", "posi", "load"}} == {
        "q.x", "position.x", "load.fx", "load.force",
    }  # fmt: skip
