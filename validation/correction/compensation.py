r"""Compute commands with which a corrected robot reaches the nominal poses.

The controller computes commands q for which the nominal robot has the target pose.  The
machine deviates from this pose by d(q), which is predicted by the model with the
identified effects.  Commands with which the machine has the target pose are computed by
the Gauss-Newton method:

 nominal pose(q) changed by the deviation d(q) = target pose

======  =============  ==========  ===================================================
symbol  code           shape       meaning
======  =============  ==========  ===================================================
q       ``drives``     (R, d)      commands of the driven joints
e       ``error``      (R, 6)      motion from the machine's pose to the target pose
J       ``jacobian``   (R, 6, d)   derivative of the platform pose by the commands
======  =============  ==========  ===================================================

If a robot has fewer than six drives, positions take priority over rotations.

Sources:
    Nocedal, Wright, Numerical Optimization, section 10.3 (Gauss-Newton).
"""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kinematics.nominal import size_of
from forcefit.assembly.kinematics.posture import place_many_joints
from forcefit.assembly.measurement.conditions import Conditions
from forcefit.assembly.measurement.predict import predict
from forcefit.assembly.measurement.settled_clearance import without_joint_clearances
from forcefit.assembly.measurement.without_clearance import flexibility
from forcefit.assembly.model.links import own_screw
from forcefit.assembly.model.robot import Robot
from forcefit.results.display import html_table, short_repr
from forcefit.stiffness.screws import rotation_matrix, rotation_vector
from forcefit.validation.campaign.campaign import Campaign
from forcefit.validation.correction.spread import deviation_spread
from forcefit.validation.diagnosis.prediction import finite_conditions

if TYPE_CHECKING:
    import pandas
    import xarray

_STEPS = 25
_HALVINGS = 8
_STILL = 1e-10  # [rad or m] largest change of a command at convergence
_TURN = np.pi  # [rad] largest accepted correction of a revolute drive
# Factor on the weight of rotation errors if the robot has fewer than six drives.
_LOW = 1e-4


@dataclass(frozen=True, eq=False)
class Compensation:
    """Corrected commands for R rows.

    Attributes:
        targets: commands at which the nominal robot has the target poses.
        drives: names of the d actuated joints.
        commands: (R, d) [rad or m] corrected commands. In rows without a solution, they
            equal the given commands.
        transforms: (R, n, 4, 4) nominal poses of the frames at the commands.
        coordinates: (R, n) [rad or m] coordinate of every joint at the commands.
        before: (R, 6) [rad, m] deviation from the target pose for the given commands,
            at the reference point, base axes.
        after: (R, 6) [rad, m] deviation from the target pose for the corrected
            commands.
        spread: (R, 6) [rad, m] standard deviation of ``after`` due to the uncertainty
            in the robot file.
        limited: (R,) bool, whether a joint limit prevents the correction.
        reason: (R,) reason why a row has no solution; empty for rows with a solution.
    """

    targets: Campaign
    drives: tuple[str, ...]
    commands: NDArray
    transforms: NDArray
    coordinates: NDArray
    before: NDArray
    after: NDArray
    spread: NDArray
    limited: NDArray
    reason: NDArray

    __repr__, _repr_html_ = short_repr, html_table

    def to_xarray(self) -> "xarray.Dataset":
        """Convert to an xarray data set over ``row``."""
        from forcefit.validation.correction.compensation_table import (
            compensation_dataset,
        )

        return compensation_dataset(self)

    def to_pandas(self) -> "pandas.DataFrame":
        """Convert to a pandas table with one row per command."""
        from forcefit.assembly.model.tables import frame_table

        return frame_table(self.to_xarray(), "row")

    @property
    def offsets(self) -> NDArray:
        """Corrections to be added to the commands of the drives, (R, d) [rad or m]."""
        return self.commands - self.targets.coordinates[:, _driven(self.targets.robot)]


def compensate(targets: Campaign, *, as_read: bool = False) -> Compensation:
    """Return commands with which a corrected robot reaches the nominal poses.

    Args:
        targets: commands for the corrected robot.
        as_read: whether effects of the measuring device are also corrected. The
            predicted readings are then zero.

    Returns:
        The corrected commands.

    Raises:
        BadInput: an effect of the robot depends on a covariate that is missing in the
            targets.
    """
    targets = _each_once(targets)
    robot, driven = targets.robot, _driven(targets.robot)
    weights = _weights(robot, len(driven))
    goal = targets.transforms[:, robot.index(robot.platform)]
    machine = _Machine(targets, goal, as_read)
    q = targets.coordinates[:, driven].copy()
    standing, reason = machine.at(q)
    before = standing.error
    limits = _limits(robot, driven)
    q, standing = _corrected(machine, standing, q, weights, limits, reason == "")
    far, reason = _too_far(robot, driven, q - targets.coordinates[:, driven], reason)
    if far.any():
        q = np.where(far[:, None], targets.coordinates[:, driven], q)
        standing = machine.at(q)[0]
    reason = _astray(robot, standing.error, reason)
    last = standing.campaign
    spread = deviation_spread(
        robot, lambda other: machine.conditions(replace(last, robot=other))
    )
    at_limit = np.asarray((q <= limits[0]) | (q >= limits[1]))
    return Compensation(
        targets=targets,
        drives=tuple(robot.frames[i].name for i in driven),
        commands=q,
        transforms=standing.conditions.transforms,
        coordinates=last.coordinates,
        before=before,
        after=standing.error,
        spread=spread,
        limited=np.asarray(at_limit.any(axis=1)),
        reason=reason,
    )


def _corrected(
    machine: "_Machine", standing: "_Standing", q: NDArray, weights: NDArray,
    limits: tuple[NDArray, NDArray], going: NDArray,
) -> tuple[NDArray, "_Standing"]:  # fmt: skip
    """Return the commands (R, d) of smallest pose error, and the state of the machine.

    Only the rows in ``going`` are corrected, by damped Gauss-Newton steps.
    """
    for _ in range(_STEPS):
        step = _step(standing, weights, q, limits)
        moving = going & (np.abs(step).max(axis=1, initial=0.0) > _STILL)
        if not moving.any():
            break
        share = moving.astype(float)
        for _ in range(_HALVINGS):
            tried = np.clip(q + share[:, None] * step, *limits)
            next_, missed = machine.at(tried)
            worse = moving & (share > 0)
            worse &= (missed != "") | ~(next_.size(weights) < standing.size(weights))
            if not worse.any():
                break
            share = np.where(worse, share / 2, share)
        # The iteration ends in a row if the error no longer decreases.
        going = going & moving & ~worse
        q = np.where(going[:, None], tried, q)
        standing = next_ if going[moving].all() else machine.at(q)[0]
    return q, standing


def _each_once(targets: Campaign) -> Campaign:
    """Return the commands, each of which is listed once for all measured points."""
    if targets.point is None:
        return targets
    labels = tuple(dict.fromkeys(targets.labels))
    first = [targets.labels.index(label) for label in labels]
    return replace(targets.take(first), points={}, point=None, ids=labels)


def _driven(robot: Robot) -> NDArray:
    """Return the indices of the frames with actuated joints, (d,)."""
    return np.flatnonzero([frame.actuated for frame in robot.frames])


def _limits(robot: Robot, driven: NDArray) -> tuple[NDArray, NDArray]:
    """Return the lower and upper limits of the commands, (d,) each."""
    given = [robot.frames[i].limits or (-np.inf, np.inf) for i in driven]
    least, most = np.array(given).reshape(-1, 2).T
    return least, most


def _too_far(
    robot: Robot, driven: NDArray, change: NDArray, reason: NDArray
) -> tuple[NDArray, NDArray]:
    """Find rows with a correction larger than the robot's size or half a turn.

    Returns:
        A mask of these rows and the reasons, (R,) each.
    """
    slides = np.array([robot.frames[i].joint == "prismatic" for i in driven])
    most = np.where(slides, size_of(robot), _TURN)
    beyond = ~(np.abs(change) <= most)
    reason = reason.copy()
    for row in np.flatnonzero(beyond.any(axis=1) & (reason == "")):
        k = int(np.argmax(beyond[row]))
        unit = "m" if slides[k] else "rad"
        reason[row] = (
            f"{robot.frames[driven[k]].name}: found a correction of "
            f"{change[row, k]:.3g} {unit}, expected at most the robot's size "
            f"({most[k]:.3g} {unit})"
        )
    return beyond.any(axis=1), reason


def _astray(robot: Robot, error: NDArray, reason: NDArray) -> NDArray:
    """Add a reason for each row whose pose error is larger than the robot."""
    size, reason = size_of(robot), reason.copy()
    off = np.linalg.norm(error[:, 3:], axis=1)
    for row in np.flatnonzero((off > size) & (reason == "")):
        reason[row] = (
            f"the smallest error that any command attains is {off[row]:.3g} m, "
            f"more than the robot's size ({size:.3g} m)"
        )
    return reason


def _weights(robot: Robot, drives: int) -> NDArray:
    """Return the weights of the components of a pose error, (6,) [m/rad, 1]."""
    turn = size_of(robot) * (1.0 if drives >= 6 else _LOW)
    return np.repeat([turn, 1.0], 3)


@dataclass(frozen=True, eq=False)
class _Standing:
    """State of a machine at given commands.

    Attributes:
        campaign: the commands.
        conditions: postures, loads and covariates at the commands.
        error: (R, 6) [rad, m] motion to the target pose; NaN without a solution.
        jacobian: (R, 6, d) derivative of the reference point's pose by the commands.
    """

    campaign: Campaign
    conditions: Conditions
    error: NDArray
    jacobian: NDArray

    def size(self, weights: NDArray) -> NDArray:
        """Return the weighted norm of the error, (R,) [m]."""
        return np.linalg.norm(self.error * weights, axis=1)


@dataclass(frozen=True, eq=False)
class _Machine:
    """Corrected robot for which commands are computed.

    Attributes:
        targets: the given commands.
        goal: (R, 4, 4) target platform poses.
        as_read: whether effects of the measuring device are also corrected.
    """

    targets: Campaign
    goal: NDArray
    as_read: bool

    def conditions(self, campaign: Campaign) -> Conditions:
        """Return the conditions at the commands for the reference point."""
        conditions = replace(finite_conditions(campaign), target=None)
        if self.as_read:
            return conditions
        still = np.zeros(6)
        return replace(conditions, base=still, tool=still[:3], reading=0.0)

    def at(self, q: NDArray) -> tuple[_Standing, NDArray]:
        """Return the state of the machine at commands (R, d), and reasons of failures.

        In unreachable rows, the given commands are used.
        """
        campaign, reason = _commanded(self.targets, q)
        conditions = self.conditions(campaign)
        prediction = predict(conditions)
        reason = np.where(reason == "", prediction.reason, reason)
        error = _between(conditions, prediction.deviation, self.goal)
        return _Standing(
            campaign, conditions, error, _jacobian(conditions, q.shape[1])
        ), reason


def _commanded(targets: Campaign, q: NDArray) -> tuple[Campaign, NDArray]:
    """Return a campaign with new commands. Unreachable commands are not changed."""
    robot = targets.robot
    driven = _driven(robot)
    wanted = np.full((len(q), len(robot.frames)), np.nan)
    wanted[:, driven] = q
    distinct, which = np.unique(wanted, axis=0, return_inverse=True)
    postures, reasons = place_many_joints(robot, distinct)
    coordinates, transforms = targets.coordinates.copy(), targets.transforms.copy()
    mismatch, reason = targets.mismatch.copy(), np.full(len(q), "", dtype=object)
    for row, k in enumerate(which.reshape(-1).tolist()):
        posture = postures[k]
        if posture is None:
            reason[row] = reasons[k]
            continue
        coordinates[row], transforms[row] = posture.coordinates, posture.transforms
        mismatch[row] = posture.mismatch
    return replace(
        targets, coordinates=coordinates, transforms=transforms, mismatch=mismatch
    ), reason


def _between(conditions: Conditions, deviation: NDArray, goal: NDArray) -> NDArray:
    """Return the motion from the current to the target pose, base axes, (R, 6)."""
    nominal = conditions.postures.platform
    arm = nominal[:, :3, :3] @ conditions.point
    R = rotation_matrix(deviation[:, :3]) @ nominal[:, :3, :3]
    p = nominal[:, :3, 3] + arm + deviation[:, 3:]
    turn = rotation_vector(goal[:, :3, :3] @ np.swapaxes(R, 1, 2))
    shift = goal[:, :3, 3] + goal[:, :3, :3] @ conditions.point - p
    return np.concatenate([turn, shift], axis=1)


def _jacobian(conditions: Conditions, drives: int) -> NDArray:
    """Return the derivative of the reference pose by the commands, (R, 6, d)."""
    robot = without_joint_clearances(conditions.robot)
    columns = np.zeros((6 * len(robot.frames), drives))
    for k, i in enumerate(_driven(robot)):
        columns[6 * i : 6 * i + 6, k] = own_screw(robot.frames[i])
    distinct, which = replace(conditions.postures, robot=robot).distinct
    J = flexibility(distinct).platform_of(columns)[which]
    arms = conditions.measured_arms[:, :, None]
    J[:, 3:] += np.cross(J[:, :3], arms, axisa=1, axisb=1, axisc=1)
    return J


def _step(
    standing: _Standing, weights: NDArray, q: NDArray, limits: tuple[NDArray, NDArray]
) -> NDArray:
    """Return the least-squares step (R, d), with 0 for drives at their limits."""
    A = standing.jacobian * weights[:, None]
    b = np.nan_to_num(standing.error) * weights
    held = np.zeros(q.shape, dtype=bool)
    step = np.zeros_like(q)
    for _ in range(q.shape[1] + 1):
        free = np.where(held[:, None, :], 0.0, A)
        rest = b - np.einsum("rij,rj->ri", A, np.where(held, step, 0.0))
        newton = np.einsum("rdi,ri->rd", np.linalg.pinv(free), rest)
        step = np.where(held, step, newton)
        beyond = ~held & ((q + step < limits[0]) | (q + step > limits[1]))
        if not beyond.any():
            break
        step = np.where(beyond, np.clip(q + step, *limits) - q, step)
        held |= beyond
    return step
