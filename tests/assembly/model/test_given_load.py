"""Loads given by component, compared with closed forms."""

from pathlib import Path

import numpy as np
import pytest

import forcefit as ff
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.model.given_load import given_load
from forcefit.assembly.model.robot import BeamLink, Frame, Robot
from forcefit.assembly.statistics.callout_sources import sources_of
from forcefit.assembly.statistics.experiment import Experiment
from forcefit.commands.options import parse_load
from forcefit.inputs.table import BadInput

FORCE, LENGTH = 50.0, 0.4
# [N m^2] bending stiffness of a round bar of 10 mm radius
STIFFNESS = 2e11 * np.pi * 0.01**4 / 4
ROOT = Path(__file__).parents[3]
HEXAPOD = ff.load_robot("hexapod")
SOURCES = sources_of(HEXAPOD, ROOT / "examples" / "hexapod_errors.toml")
TIP = -FORCE * LENGTH**3 / (3 * STIFFNESS)  # [m]


def cantilever():
    beam = BeamLink({"radius": 0.01}, 2e11, 0.3, theory="euler", density=7800.0)
    tip = Frame("tip", translation=[LENGTH, 0, 0], link=beam)
    return home_posture(Robot("bar", "tip", (tip,)))


def test_cantilever_deflection_under_a_named_force_equals_beam_theory():
    """The deflection is F L^3 / (3 E I)."""
    forced = ff.solve_assembly(cantilever(), {"fz": -FORCE})
    assert forced.platform_screw[5] == pytest.approx(TIP)
    exact = ff.solve_exact(cantilever(), load={"fz": -FORCE})
    assert exact.platform_screw[5] == pytest.approx(TIP, rel=1e-4)


def test_named_moment_and_force_superpose():
    """The deflection M L^2 / (2 E I) of the moment cancels that of the force."""
    moment = -2 / 3 * FORCE * LENGTH
    forced = ff.solve_assembly(cantilever(), {"fz": -FORCE, "my": moment})
    assert abs(forced.platform_screw[5]) < 1e-9 * abs(TIP)


def test_list_of_values_of_a_component_gives_one_load_per_point():
    forces = np.array([-50.0, 0.0, 25.0])
    many = ff.solve_assembly(cantilever(), {"fz": forces})
    np.testing.assert_allclose(
        many.platform_screw[:, 5], -forces / FORCE * TIP, atol=1e-18
    )


SAME = {
    "platform_stiffness": lambda load: (
        ff.platform_stiffness(cantilever(), "exact", load).stiffness
    ),
    "deflection_curve": lambda load: (
        ff.deflection_curve(cantilever(), 3, [0.0, 10.0], load).screws
    ),
    "natural_modes": lambda load: (
        ff.natural_modes(cantilever(), 2, load, state="exact").frequencies
    ),
    "sweep": lambda load: (
        ff.sweep("irsbot2", grid="tx=0:0.1:0.1,tz=-0.5", load=load, assumption="none")
        .energy.values
    ),
    "Experiment": lambda load: (
        Experiment(home_posture(HEXAPOD), SOURCES, load=load).energies.load
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", sorted(SAME))
def test_load_given_by_components_equals_load_given_as_array(name):
    by_name, in_order = {"fz": -50, "mx": 1.5}, [1.5, 0, 0, 0, 0, -50]
    np.testing.assert_array_equal(SAME[name](by_name), SAME[name](in_order))
    assert not np.array_equal(SAME[name](by_name), SAME[name]([0.0] * 6))


def test_command_line_and_python_accept_the_same_loads():
    assert parse_load(["fz=-50,mx=1.5"]) == [1.5, 0, 0, 0, 0, -50]
    assert given_load({"fz": -50, "mx": 1.5}).tolist() == [1.5, 0, 0, 0, 0, -50]


@pytest.mark.parametrize(
    ("load", "message"),
    [
        ({"fq": 1.0}, 'load: unknown component "fq"; valid: fx, fy, fz, mx, my, mz'),
        ({"FZ": 1.0}, 'load: unknown component "FZ"'),
        ({"fz": "heavy"}, "load fz: found 'heavy', expected a number [N]"),
        ({"my": np.nan}, "load my: found nan, expected a number [N m] of magnitude"),
        ({"fz": [1, 2], "fx": [1, 2, 3]}, "load: found fz 2, fx 3 numbers"),
    ],
)  # fmt: skip
def test_message_about_an_invalid_load_contains_the_value(load, message):
    with pytest.raises(BadInput) as found:
        ff.solve_assembly(cantilever(), load)
    assert str(found.value).startswith(message)


def test_message_about_too_many_loads_contains_their_number():
    with pytest.raises(BadInput, match=r"load: found .* expected 6 numbers \[N m, N\]"):
        ff.platform_stiffness(cantilever(), load={"fz": [1.0, 2.0]})
