"""Test that effects of simulated machines are identified.

The simulation shares no code with the library effects.  Each saved robot is also tested
in new configurations.
"""

from dataclasses import replace

import numpy as np
import pytest

from forcefit.assembly.files.robot_file import read_robot
from forcefit.assembly.model.robot import Frame, Robot
from forcefit.validation.campaign.campaign_file import read_campaign
from forcefit.validation.correction.prediction import predict
from forcefit.validation.diagnosis.diagnose import diagnose
from forcefit.validation.diagnosis.results import table
from forcefit.validation.diagnosis.saving import save
from forcefit.validation.synthetic.design import CampaignDesign, plan_campaign
from forcefit.validation.synthetic.generator import generate_campaign, write_campaign
from forcefit.validation.synthetic.machine import Hidden, simulate_readings
from tests.elastic_arm_for_tests import SPRING, TUBE, arm, with_errors

pytestmark = pytest.mark.slow

SLIDE = np.diag([np.inf] * 5 + [3e6])
POINT = (0.02, 0.05, 0.03)
DESIGN = CampaignDesign(24, 116, load=40.0, reach=0.8, reference_point=POINT)
LONG = replace(DESIGN, reach=1.0, size=0.1)  # slides with a travel of 0.2 m
NEAR = 3.0  # largest accepted error in standard deviations


def longer_arm():
    """Return an arm with four drives and bodies with mass."""
    j1, *others = arm().frames
    j2, j3, tool = (replace(frame, mass=0.8) for frame in others)
    j4 = replace(
        j3, name="j4", parent="j3", translation=np.array([0.25, 0.1, 0.1]),
        rotation=np.array([np.pi / 3, 0, 0]),
    )  # fmt: skip
    last = replace(tool, parent="j4", translation=np.array([0.2, 0.05, 0.1]))
    return Robot("arm", "tool", (j1, j2, j3, j4, last))


def gantry():
    """Return a gantry with three slides and a rotating head."""
    sliding = {"joint": "prismatic", "actuated": True, "joint_stiffness": SLIDE}
    turning = {"joint": "revolute", "actuated": True, "joint_stiffness": SPRING}
    return Robot("gantry", "tool", (
        Frame("x", "base", [0, 0, 0.5], [0, np.pi / 2, 0], **sliding),
        Frame("y", "x", [0.1, 0, 0.2], [np.pi / 2, 0, 0], **sliding),
        Frame("z", "y", [0.2, 0.1, 0], [0, np.pi / 2, 0], **sliding),
        Frame("head", "z", [0.1, 0.1, 0.2], [0, np.pi / 3, 0], **turning),
        Frame("tool", "head", [0.15, 0.05, 0.1], link=TUBE, mass=0.8),
    ))  # fmt: skip


@pytest.fixture
def hidden(tmp_path):
    """Return a function that simulates and diagnoses a machine with one effect.

    The effect is five times the noise.  The function returns the diagnosis and the true
    parameters.
    """

    def find(robot, name, parameters, design=DESIGN, units=""):
        robot, effect = with_errors(robot), Hidden(name, parameters)
        made = generate_campaign(
            robot, [(effect, 5.0)], design, seed=7, program="springs"
        )
        other = np.random.default_rng(11)
        plan = plan_campaign(robot, design, other)
        exact = simulate_readings(
            robot, made.reference_point, plan.rows, made.effects, "springs"
        )
        noise = made.sigma * other.normal(size=exact.shape)
        fresh = replace(made, plan=plan, readings=exact + noise)
        campaigns = []
        for folder, one in (("learned", made), ("fresh", fresh)):
            write_campaign(one, tmp_path / folder)
            with open(tmp_path / folder / "campaign.toml", "a") as file:
                file.write(units)
            campaigns.append(read_campaign(tmp_path / folder))
        found = diagnose(campaigns[0])
        save(found, tmp_path / "robot.toml")
        saved = read_robot(tmp_path / "robot.toml")
        assert predict(replace(campaigns[1], robot=saved)).error.normalised < 1.1
        return table(found), made.effects[0].parameters

    return find


def only(learned, *, where, form, of):
    """Return the parameters of the single learned function."""
    (one,) = learned["learned"]
    others = [same[0]["where"] for same in one["equivalent_places"]]
    assert where in [one["where"], *others]
    assert (one["form"], one["variables"]) == (form, of)
    assert learned["verdict"] == "learned"
    return one["parameters"], one["std"]


def assert_near(found, std, truth):
    for key, value in truth.items():
        assert abs(found[key] - value) < NEAR * std[key], key


LEAD = {"y.amplitude": 1e-5, "y.phase": 0.7, "y.period": 0.012}


def test_lead_error_of_a_screw_is_identified_with_its_period(hidden):
    """The error a sin(2 pi y / p + f) is identified as a sine and a cosine."""
    found, true = hidden(gantry(), "_lead", LEAD, LONG)
    values, std = only(found, where="y", form="waves", of=["q.y"])
    assert values["period"] == pytest.approx(0.012, rel=0.01)
    a = true["y.amplitude"]
    parts = {"1.sine": a * np.cos(0.7), "1.cosine": a * np.sin(0.7)}
    assert_near(values, std, {"period": 0.012} | parts)


def test_backlash_that_varies_with_the_screw_angle_is_identified(hidden):
    found, true = hidden(gantry(), "_lead_backlash", LEAD, LONG)
    values, std = only(found, where="y", form="reversal_waves", of=["approach", "q.y"])
    assert values["period"] == pytest.approx(0.012, rel=0.01)
    a = true["y.amplitude"]
    parts = {"1.sine": 0.8 * a * np.cos(0.7), "1.cosine": 0.8 * a * np.sin(0.7)}
    assert_near(values, std, {"0.cosine": a} | parts)


@pytest.mark.parametrize(("below", "above"), [(1e-5, 2e-6), (2e-6, 1e-5)])
def test_joint_with_two_compliances_is_identified(hidden, below, above):
    given = {"j2.below": below, "j2.above": above, "j2.knee": 4.0}
    found, true = hidden(arm(), "_two_steps", given)
    values, std = only(found, where="j2", form="knee", of=["wrench.j2.mz"])
    truth = {"at": "knee", "below": "below", "above": "above"}
    assert_near(values, std, {k: true[f"j2.{v}"] for k, v in truth.items()})


def test_backlash_that_depends_on_the_load_sign_is_identified(hidden):
    found, true = hidden(arm(), "_torque_backlash", {"j2": 5e-5})
    values, std = only(found, where="j2", form="knee", of=["wrench.j2.mz"])
    assert_near(values, std, {"size": true["j2"]})


def claimed(found, name, where):
    """Return parameters and standard deviations of the only claimed effect."""
    (one,) = found["effects"]
    assert (found["verdict"], one["name"], one["where"]) == ("explained", name, where)
    rows = one["parameters"]
    return ({p["name"]: p[key] for p in rows} for key in ("value", "std"))


def test_mass_and_first_moments_of_a_body_are_identified(hidden):
    """The first moments determine the centre of mass."""
    given = {"j4.mass": 0.5, "j4.moment.x": 0.05, "j4.moment.y": 0.03}
    weighed = replace(DESIGN, gravity=9.81)
    found, true = hidden(longer_arm(), "body_mass", given, weighed)
    assert_near(*claimed(found, "body_mass", ["j4"]), true)


@pytest.mark.parametrize(("name", "where"), [
    ("thermal_expansion", ["j2", "j3", "tool"]), ("link_length", ["j3"])
])  # fmt: skip
def test_expansion_and_length_of_rigid_bodies_are_identified(hidden, name, where):
    found, true = hidden(arm(link=None), name, dict.fromkeys(where, 2e-5))
    assert_near(*claimed(found, name, where), true)


def test_gain_of_a_measured_motion_is_identified(hidden):
    found, true = hidden(
        arm(), "_tilting", {"gain": 0.93}, replace(DESIGN, tilt=1e-4),
        '[units]\ncov.tilt = "rad"\n',
    )  # fmt: skip
    values, std = only(found, where="j1", form="powers", of=["cov.tilt"])
    assert_near(values, std, {"1": true["gain"]})
    gain = f"{values['1']:.3g} +- {std['1']:.1g}"
    named = f"measured motion of j1 by tilt, gain {gain}"
    assert found["learned"][0]["label"] == named
