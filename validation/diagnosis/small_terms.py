"""Terms of many small unknowns that every machine has: geometric errors and springs.

Nobody makes a frame exactly where it was drawn, and nothing is rigid.  Each of these
unknowns has a Gaussian prior about what is declared: from the frame's ``tolerance``, or
of one size for all rotations and one for all translations that the readings are asked
for (:mod:`validation.diagnosis.evidence`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from assembly.kinematics.nominal import size_of
from assembly.measurement.conditions import Conditions
from assembly.model.links import in_series
from assembly.model.robot import Robot
from validation.campaign.campaign import Campaign
from validation.diagnosis.responses import Responses
from validation.diagnosis.signatures import UNSEEN

GEOMETRY, SPRINGS = SMALL = ("geometry", "springs")
KINDS = ("rotation", "translation")
LARGEST_TURN = 0.2  # [rad] no error of a drive, a frame or a device is larger
LARGEST_SHIFT = 0.1  # of the robot's size, likewise


@dataclass(frozen=True, eq=False)
class SmallTerm:
    """k small unknowns of one kind and how the readings answer to them.

    Attributes:
        name: ``"geometry"`` or ``"springs"``.
        frame: (k,) row of the frame in the campaign's robot.
        axis: (k,) component of the screw there, 0 to 5.
        columns: (N, k) change of the whitened readings per unknown.
        given: (k,) standard deviation of the prior, NaN where it is asked for.
        lower: the unknowns' lower bound: springs only add compliance.
        sure: whether it is there whatever the readings say.
        most: of rotations and of translations, largest size that the readings may ask
            for.
    """

    name: str
    frame: NDArray
    axis: NDArray
    columns: NDArray
    given: NDArray
    lower: float
    sure: bool = False
    most: tuple[float, float] = (np.inf, np.inf)

    def __len__(self) -> int:
        return len(self.frame)

    @property
    def group(self) -> NDArray:
        """(k,) 0 for rotations, 1 for translations, -1 where the prior is given."""
        return np.where(np.isfinite(self.given), -1, self.axis // 3)

    def take(
        self, unknowns: NDArray, rows: NDArray | slice = slice(None)
    ) -> "SmallTerm":
        """Some of the unknowns, in some of the cells.

        Args:
            unknowns: mask (k,) or numbers.
            rows: of the whitened readings.

        Returns:
            The smaller term.
        """
        return replace(
            self, frame=self.frame[unknowns], axis=self.axis[unknowns],
            columns=self.columns[rows][:, unknowns], given=self.given[unknowns],
        )  # fmt: skip


def small_terms(
    campaign: Campaign, conditions: Conditions, response: Responses
) -> list[SmallTerm]:
    """Geometry and springs of a campaign's robot.

    Args:
        campaign: of R rows, N measured cells.
        conditions: its conditions as declared.
        response: of the readings there.

    Returns:
        Terms whose unknowns show in the readings; none of a kind that does not.
    """
    frames = campaign.robot.frames
    own = [conditions.robot.index(frame.name) for frame in frames]
    screws = response.screws[:, :, own]
    given = np.array([
        np.full(6, np.nan) if frame.tolerance is None else frame.tolerance
        for frame in frames
    ])
    most = LARGEST_TURN, LARGEST_SHIFT * size_of(campaign.robot)
    geometry = _term(campaign, GEOMETRY, screws, given, -np.inf, most)
    bent = screws * response.wrenches[:, None, own]
    # what closures meet at, and the platform, have no spring of their own
    bent[:, :, [not _may_give(campaign.robot, f.name) for f in frames]] = 0.0
    springs = _term(campaign, SPRINGS, bent, np.full((len(frames), 6), np.nan), 0.0)
    return [term for term in (geometry, springs) if len(term)]


def _may_give(robot: Robot, name: str) -> bool:
    """Whether a frame may have a joint stiffness."""
    return name != robot.platform and all(name not in pair for pair in robot.closures)


def _term(
    campaign: Campaign, name: str, changes: NDArray, given: NDArray, lower: float,
    most: tuple[float, float] = (np.inf, np.inf),
) -> SmallTerm:  # fmt: skip
    """The unknowns of changes (R, 6, n, 6) that show at all."""
    whitened = changes[campaign.cells] / campaign.sigma[campaign.cells][:, None, None]
    count = whitened.shape[1]
    columns = whitened.reshape(len(whitened), 6 * count)
    size = np.linalg.norm(columns, axis=0)
    axis = np.tile(np.arange(6), count)
    largest = np.array([size[axis // 3 == kind].max(initial=0.0) for kind in (0, 1)])
    known = given.reshape(-1)
    # a tolerance of zero says that a direction is exact
    shown = (size > 1e-9 * largest[axis // 3]) & ~(known == 0.0)
    shown &= size > UNSEEN / np.array(most)[axis // 3]
    frame = np.repeat(np.arange(count), 6)
    return SmallTerm(
        name=name,
        frame=frame[shown],
        axis=axis[shown],
        columns=columns[:, shown],
        given=known[shown],
        lower=lower,
        sure=bool(np.isfinite(known[shown]).any()),
        most=most,
    )


def added(
    campaign: Campaign, response: Responses, conditions: Conditions,
    terms: Sequence[SmallTerm], values: Sequence[NDArray],
) -> NDArray:  # fmt: skip
    """What geometric errors and springs add to the readings of any rows.

    Args:
        campaign: of R rows.
        response: of its readings.
        conditions: its conditions.
        terms: found on these rows or on others of the same robot; others than
            geometry and springs are passed over.
        values: (k,) of each term.

    Returns:
        (R, 6) [rad, m].
    """
    total = np.zeros((len(conditions), 6))
    own = np.array([
        conditions.robot.index(frame.name) for frame in campaign.robot.frames
    ])
    for term, x in zip(terms, values, strict=True):
        if term.name not in {GEOMETRY, SPRINGS}:
            continue
        rows = own[term.frame]
        amount = np.broadcast_to(x, (len(conditions), len(x)))
        if term.name == SPRINGS:
            amount = amount * response.wrenches[:, rows, term.axis]
        total += np.einsum("rik,rk->ri", response.screws[:, :, rows, term.axis], amount)
    return total


def screws_of(
    campaign: Campaign, terms: Sequence[SmallTerm], values: Sequence[NDArray]
) -> NDArray:
    """(n, 6) [rad, m] geometric errors of all frames among small unknowns."""
    errors = np.zeros((len(campaign.robot.frames), 6))
    for term, x in zip(terms, values, strict=True):
        if term.name == GEOMETRY:
            errors[term.frame, term.axis] = x
    return errors


def with_error(robot: Robot, frame: NDArray, axis: NDArray, x: NDArray) -> Robot:
    """A robot whose geometric errors are larger by x (k,) [rad, m] at frames and axes.

    Args:
        robot: any.
        frame: (k,) rows of frames.
        axis: (k,) components of the screw there, 0 to 5.
        x: (k,) what is added.

    Returns:
        The robot.
    """
    errors = robot.errors.copy()
    np.add.at(errors, (frame, axis), x)
    return robot.with_errors(errors)


def with_compliance(robot: Robot, frame: NDArray, axis: NDArray, x: NDArray) -> Robot:
    """A robot with compliances x (k,) in series with its joints; 0 changes nothing.

    Args:
        robot: any.
        frame: (k,) rows of frames.
        axis: (k,) components of the screw there, 0 to 5.
        x: (k,) [rad/(N m), m/N].

    Returns:
        The robot.
    """
    frames = list(robot.frames)
    for i, a, c in zip(frame.tolist(), axis.tolist(), x.tolist(), strict=True):
        if c > 0.0:
            K = in_series(frames[i].resistance, a, c)
            frames[i] = replace(frames[i], joint_stiffness=K)
    return replace(robot, frames=tuple(frames))
