"""Simulated measurements of a bar that one drive turns about z."""

import numpy as np

from forcefit.assembly.effects.effect import Unknown
from forcefit.assembly.kinematics.posture import place_robot
from forcefit.assembly.measurement.predict import with_second_order
from forcefit.assembly.model.robot import BeamLink, Frame, Robot
from forcefit.validation.diagnosis.claims import parameters_of
from forcefit.validation.diagnosis.columns import Columns
from forcefit.validation.diagnosis.derivatives import Derivatives
from forcefit.validation.diagnosis.fit import fit_machine
from forcefit.validation.diagnosis.hypotheses import Hypothesis, Slot
from forcefit.validation.diagnosis.signatures import conditions_of
from forcefit.validation.diagnosis.unknowns import Acting, Unknowns
from tests.campaigns_for_tests import campaign_at
from tests.planar_arm_for_tests import SIGMA

LENGTH = 0.8


def bar(load=None, measured=None, link=None, rows=8, spread=2.0, spring=None,
        **covariates):  # fmt: skip
    """Return a campaign of a bar along x on a drive about z, at ``rows`` angles."""
    robot = Robot("bar", "tip", (
        Frame("drive", joint="revolute", actuated=True, joint_stiffness=spring),
        Frame("tip", "drive", [LENGTH, 0, 0], link=link),
    ))  # fmt: skip
    placed = [
        place_robot(robot, joints={"drive": q}) for q in np.linspace(0, spread, rows)
    ]
    return campaign_at(
        robot, placed, np.zeros((rows, 6)) if measured is None else measured, SIGMA,
        loads=np.zeros((rows, 6)) if load is None else np.tile(load, (rows, 1)),
        covariates=covariates,
    )  # fmt: skip


def along(campaign):
    """Return the direction of the bar in each row, (R, 3)."""
    q = campaign.coordinates[:, 0]
    return np.column_stack([np.cos(q), np.sin(q), 0 * q])


def hypothesis(effect, frame, name, unknown):
    return Hypothesis(effect, (frame,), (Slot((name,), unknown, unknown.start),))


BEAM = BeamLink({"radius": 0.03}, 70e9, 0.33)
LONGER = hypothesis("link_length", "tip", "tip", Unknown("", 1e-4))
WARMER = hypothesis("thermal_expansion", "tip", "tip", Unknown("", 1e-5, -5e-4, 5e-4))
TURNED = hypothesis("encoder_offset", "drive", "drive", Unknown("", 1e-4))
ECCENTRIC = hypothesis(
    "encoder_eccentricity", "drive", "drive.cosine", Unknown("cosine", 1e-4)
)
SOFTER = hypothesis(
    "drive_compliance", "drive", "drive.compliance", Unknown("compliance", 1e-6, 0, 1)
)


def fit_of(campaign, longer):
    return np.hstack([np.zeros((len(campaign), 3)), longer * along(campaign)])


def gives_way(M, k):
    """Return readings under a moment M if the drive has stiffness k.

    The drive turns by M/k, and the tip moves by M L/k.
    """
    across = np.cross([0, 0, 1], along(bar()))
    seen = np.hstack([np.tile([0, 0, M / k], (8, 1)), M * LENGTH / k * across])
    return bar([0, 0, M, 0, 0, 0], seen)


def machine(campaign, *hypotheses, start=0.0):
    """Fit the unknowns of some hypotheses to all rows of a campaign."""
    parts = [Acting(h, np.full(len(h.slots), start)) for h in hypotheses]
    unknowns = Unknowns(campaign.robot, tuple(parts))
    return fit_machine(campaign, unknowns, np.ones(len(campaign), bool))


def columns_of(campaign):
    """Return the derivative columns of all effects and functions."""
    return Columns(campaign, Derivatives(with_second_order(conditions_of(campaign))))


def numbers(fit):
    """Return name, value and standard deviation of each fitted parameter."""
    found = parameters_of(fit, fit.unknowns.effects[0])
    return [(one.name, one.value, one.std) for one in found]
