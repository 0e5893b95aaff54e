"""Describe the nuisance parameters: geometric errors and joint compliances.

Every machine has small geometric errors and compliances.  Each of these unknowns has a
Gaussian prior about its declared value.  The prior standard deviation is the
``tolerance`` of the frame.  Without a tolerance, all unknowns of a group have the same
prior standard deviation, which is estimated from the readings.
"""

from collections.abc import Container
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kinematics.nominal import size_of
from forcefit.assembly.measurement.conditions import Conditions
from forcefit.assembly.model.links import in_series
from forcefit.assembly.model.robot import Robot
from forcefit.validation.campaign.campaign import Campaign
from forcefit.validation.diagnosis.responses import Responses
from forcefit.validation.diagnosis.signatures import UNSEEN, whiten

GEOMETRY, SPRINGS = "geometry", "springs"
KINDS = ("rotation", "translation")
LARGEST_TURN = 0.2  # [rad] largest plausible rotation error of a frame or drive
# Largest plausible translation of a frame, relative to the size of the robot.
LARGEST_SHIFT = 0.1
# Norm of a column that is treated as zero, relative to the largest norm in its group.
_ROUNDING = 1e-9
_SAME = 1 - 1e-6  # smallest cosine of two parallel columns


@dataclass(frozen=True, eq=False)
class Nuisance:
    """Design matrix and priors of k unknown geometric errors and joint compliances.

    Attributes:
        columns: (N, k) change of the whitened readings per unknown.
        spring: (k,) bool, True for a spring, whose compliance cannot be negative.
        frame: (k,) index of the frame in the campaign's robot.
        axis: (k,) screw component at the frame, 0 to 5.
        given: (k,) declared prior standard deviation, NaN if it is not declared.
        most: (k,) largest plausible standard deviation.
    """

    columns: NDArray
    spring: NDArray
    frame: NDArray
    axis: NDArray
    given: NDArray
    most: NDArray

    @property
    def group(self) -> NDArray:
        """Group (k,) of each unknown.

        The groups are 0 and 1 for rotations and translations of frames, and 2 and 3 for
        rotational and translational springs.
        """
        return 2 * self.spring + self.axis // 3

    @property
    def declared(self) -> bool:
        """Whether the robot file declares tolerances."""
        return bool(np.isfinite(self.given).any())

    def take(self, unknowns: NDArray) -> "Nuisance":
        """Return the unknowns that a mask (k,) or indices select."""
        return Nuisance(
            self.columns[:, unknowns], self.spring[unknowns], self.frame[unknowns],
            self.axis[unknowns], self.given[unknowns], self.most[unknowns],
        )  # fmt: skip


def nuisance(
    campaign: Campaign, conditions: Conditions, response: Responses, named: NDArray,
    kinds: Container[str] = (GEOMETRY, SPRINGS),
) -> Nuisance:  # fmt: skip
    """Return the geometric errors and springs that affect the readings.

    Args:
        campaign: the measurements.
        conditions: declared conditions of the campaign.
        response: changes of the readings per unit screw at the frames.
        named: (N, c) design matrix of library effects with a single unknown. Springs
            with a parallel column are omitted.
        kinds: kinds of nuisance parameters to return.
    """
    robot, n = campaign.robot, len(campaign.robot.frames)
    own = [conditions.robot.index(frame.name) for frame in robot.frames]
    screws, carried = response.screws[:, :, own], response.wrenches[:, own]
    # Frames of loop closures and of the platform cannot have a joint spring.
    carried[:, [not _may_give(robot, f.name) for f in robot.frames]] = 0.0
    changes = np.concatenate([screws, screws * carried[:, None]], axis=2)
    given = np.full((2 * n, 6), np.nan)
    for row, frame in enumerate(robot.frames):
        if frame.tolerance is not None:
            given[row] = frame.tolerance
    axis = np.tile(np.arange(6), 2 * n)
    spring = np.repeat([False, True], 6 * n)
    largest = LARGEST_TURN, LARGEST_SHIFT * size_of(robot)
    every = Nuisance(
        columns=whiten(campaign, changes.reshape(*changes.shape[:2], -1)),
        spring=spring,
        frame=np.tile(np.repeat(np.arange(n), 6), 2),
        axis=axis,
        given=given.ravel(),
        most=np.where(spring, np.inf, np.array(largest)[axis // 3]),
    )
    wanted = np.array([GEOMETRY in kinds, SPRINGS in kinds])
    shown = every.take(visible(every) & wanted[every.spring.astype(int)])
    return shown.take(~(shown.spring & _is_among(shown.columns, named)))


def _may_give(robot: Robot, name: str) -> bool:
    """Return whether a frame can have a joint stiffness."""
    return name != robot.platform and all(name not in pair for pair in robot.closures)


def visible(small: Nuisance) -> NDArray:
    """Return a mask (k,) of the unknowns that affect the readings."""
    size = np.linalg.norm(small.columns, axis=0)
    largest = np.zeros(4)
    np.maximum.at(largest, small.group, size)
    # A tolerance of zero excludes a geometric error.
    shown = (size > _ROUNDING * largest[small.group]) & ~(small.given == 0.0)
    return np.asarray(shown & (size > UNSEEN / small.most))


def _is_among(columns: NDArray, named: NDArray) -> NDArray:
    """Return a mask (k,) of columns that are parallel to one of another matrix."""
    unit = [c / np.maximum(np.linalg.norm(c, axis=0), 1e-300) for c in (named, columns)]
    return np.asarray((np.abs(unit[0].T @ unit[1]) > _SAME).any(axis=0))


def with_error(robot: Robot, frame: NDArray, axis: NDArray, x: NDArray) -> Robot:
    """Return a robot with additional geometric errors.

    Args:
        robot: the robot.
        frame: (k,) indices of frames.
        axis: (k,) screw components at these frames, 0 to 5.
        x: (k,) [rad, m] errors to add.
    """
    errors = robot.errors.copy()
    np.add.at(errors, (frame, axis), x)
    return robot.with_errors(errors)


def with_compliance(robot: Robot, frame: NDArray, axis: NDArray, x: NDArray) -> Robot:
    """Return a robot with additional compliances in series with its joints.

    Args:
        robot: the robot.
        frame: (k,) indices of frames.
        axis: (k,) screw components at these frames, 0 to 5.
        x: (k,) [rad/(N m), m/N] compliances to add.
    """
    frames = list(robot.frames)
    for i, a, c in zip(frame.tolist(), axis.tolist(), x.tolist(), strict=True):
        if c > 0.0:
            K = in_series(frames[i].resistance, a, c)
            frames[i] = replace(frames[i], joint_stiffness=K)
    return replace(robot, frames=tuple(frames))
