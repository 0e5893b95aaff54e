r"""Fit a saved robot to the set-up rows of a new session and test it on other rows.

Set-up rows are measured at the beginning of a session.  The parameters of a session are
the pose of the measuring device, the changes with time and, if requested, the measured
point and the zeros of the joints (:mod:`.session_unknowns`).  The prior of the robot's
parameters consists of their saved values and covariance (:mod:`.machine_numbers`).  All
parameters are fitted to the set-up rows of all sessions (:mod:`.session_fit`) and
tested on the other rows.

The uncertainty of the fit is propagated to the other rows.  The set-up rows are
insufficient if this uncertainty exceeds the residual of the saved robot in the set-up
rows.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.model.robot import Robot
from forcefit.inputs.errors import BadInput, quoted
from forcefit.results.display import html_table, short_repr
from forcefit.validation.campaign.campaign import Campaign
from forcefit.validation.correction.machine_numbers import machine_numbers, unchanging
from forcefit.validation.correction.session_fit import SessionsFit, SetUp, fit_sessions
from forcefit.validation.correction.session_unknowns import (
    DRIFT,
    SessionUnknowns,
    of_one_session,
    session_unknowns,
    without_session,
)
from forcefit.validation.diagnosis.sequence import Errors, errors_of
from forcefit.validation.diagnosis.unknowns import effects_in, with_effects_in

_MACHINE = "the robot's own numbers"


@dataclass(frozen=True, eq=False)
class Carried:
    """Fitted values and errors of one session.

    Attributes:
        session: name of the session; None if the campaign has no sessions.
        unknowns: the k fitted parameters.
        values: (k,) [rad, m] fitted values.
        std: (k,) standard deviations of the values.
        rows: number of set-up rows, and number of all other rows.
        error: prediction error on the other rows.
        declared: prediction error of the declared robot, fitted to the same set-up
            rows.
        uncertainty: [m] rms uncertainty of the predicted points of the other rows.
        left: [m] rms residual of the set-up rows.
        held: [m] rms residual of the set-up rows if the robot parameters keep their
            saved values.
        open_: names of the most uncertain parameters; empty if the set-up rows suffice.
        left_behind: names of the changes with time that cannot be fitted, because the
            new session has no column ``cov.time``.
    """

    session: str | None
    unknowns: SessionUnknowns
    values: NDArray
    std: NDArray
    rows: tuple[int, int]
    error: Errors
    declared: Errors
    uncertainty: float
    left: float
    held: float
    open_: tuple[str, ...]
    left_behind: tuple[str, ...]

    __repr__, _repr_html_ = short_repr, html_table

    @property
    def suffices(self) -> bool:
        """Whether the set-up rows determine the parameters accurately enough."""
        return not self.open_

    @property
    def better(self) -> bool:
        """Whether the other rows are predicted better than by the declared robot."""
        error, declared = self.error.normalised, self.declared.normalised
        return math.isnan(declared) or error <= declared


@dataclass(frozen=True, eq=False)
class CarriedRobot:
    """A robot that was fitted to new sessions.

    Attributes:
        fit: fitted parameters of the sessions and of the robot.
        sessions: result of each session.
    """

    fit: SessionsFit
    sessions: tuple[Carried, ...]

    @property
    def good(self) -> bool:
        """Whether the set-up rows suffice and predictions improve in all sessions."""
        return all(one.suffices and one.better for one in self.sessions)


def carry(
    campaign: Campaign,
    declared: Campaign,
    setup: NDArray,
    fitted: Sequence[str] = ("registration",),
) -> CarriedRobot:
    """Fit a saved robot to the set-up rows of sessions and test it on the other rows.

    Args:
        campaign: campaign with the saved robot.
        declared: the same campaign with the declared robot.
        setup: (R,) bool, True for set-up rows.
        fitted: names of parameters in :data:`OF_A_SESSION`.

    Returns:
        The fitted robot and the result of each session.

    Raises:
        BadInput: all rows of a session are set-up rows, or none.
    """
    clock = "time" in campaign.covariates
    unknowns = session_unknowns(campaign.robot, fitted, clock=clock)
    masks = [_of(campaign, session, setup) for session in _sessions(campaign)]
    fits = []
    for data, machine in (
        (campaign, machine_numbers(campaign.robot)),
        (declared, unchanging(declared.robot)),
    ):
        rows = [SetUp(data.take(own), setup[own], unknowns) for own in masks]
        fits.append(fit_sessions(rows, machine))
    behind = _left_behind(campaign.robot, unknowns)
    sessions = tuple(
        replace(_judged(fits[0], fits[1], number), session=session, left_behind=behind)
        for number, session in enumerate(_sessions(campaign))
    )
    return CarriedRobot(fits[0], sessions)


def _sessions(campaign: Campaign) -> tuple[str | None, ...]:
    """Return the names of the sessions, or (None,) for a campaign without sessions."""
    return campaign.sessions or (None,)


def _of(campaign: Campaign, session: str | None, setup: NDArray) -> NDArray:
    """Return a mask (R,) of a session's rows, and check its set-up rows."""
    own = campaign.in_session(session)
    if setup[own].any() and not setup[own].all():
        return own
    which = f"session {quoted(session)}" if session is not None else campaign.name
    rows = "only set-up rows" if setup[own].any() else "no set-up rows"
    raise BadInput(
        f"--setup: found {rows} in {which}; expected set-up rows and other rows"
    )


def _left_behind(robot: Robot, unknowns: SessionUnknowns) -> tuple[str, ...]:
    """Return the names of changes with time that cannot be fitted in a session."""
    drift, functions = of_one_session(robot)
    whole = [DRIFT] if drift and unknowns.constant is None else []
    return (*whole, *(f.title for f in functions if f not in unknowns.functions))


def _judged(fit: SessionsFit, other: SessionsFit, number: int) -> Carried:
    """Return the result of a session, with errors on the rows that were not fitted."""
    one, alike = fit.sessions[number], other.sessions[number]
    campaign, setup, values = one.campaign, one.rows, fit.values(number)
    read = one.read(fit.robot, values)
    declared = alike.read(other.robot, other.values(number))
    own = campaign.cells & setup[:, None]
    own[:, :3] &= not own[:, 3:].any()
    held = one.read(fit.machine.robot, fit.held[fit.own(number)])
    off = [
        float(np.sqrt(np.mean((campaign.measured - there)[own] ** 2)))
        for there in (read, held)
    ]
    level = max(*off, float(np.median(campaign.sigma[own])))
    cells = campaign.cells & ~setup[:, None]
    # Rotations are ignored if any position was measured.
    cells[:, :3] &= not cells[:, 3:].any()
    variance, blame = fit.spread(number, cells)
    names = [*(name for _, name in one.unknowns.names), _MACHINE]
    worst = np.flatnonzero(blame > 0.1 * blame.max()).tolist()
    C = fit.covariance[fit.own(number), fit.own(number)]
    return Carried(
        session=None,
        unknowns=one.unknowns,
        values=values,
        std=np.sqrt(np.diag(C)),
        rows=(int(setup.sum()), int((~setup).sum())),
        error=errors_of(campaign, campaign.measured - read, ~setup),
        declared=errors_of(campaign, campaign.measured - declared, ~setup),
        uncertainty=float(np.sqrt(variance)),
        left=off[0],
        held=off[1],
        open_=() if variance <= level**2 else tuple(names[k] for k in worst),
        left_behind=(),
    )


def carried_robot(carried: CarriedRobot) -> Robot:
    """Return the fitted robot without the parameters of its original session.

    Args:
        carried: the robot, fitted to the new sessions.
    """
    robot = without_session(carried.fit.robot)
    for number, one in enumerate(carried.sessions):
        values = carried.fit.values(number)
        effects = one.unknowns.effects(values)
        functions = one.unknowns.functions_with(values, one.session)
        robot = replace(robot, functions=(*robot.functions, *functions))
        both = _added(effects_in(robot, one.session), effects)
        robot = with_effects_in(robot, one.session, both)
    return robot


def _added(before: Any, more: dict[str, dict[str, float]]) -> dict[str, Any]:
    """Return effects with changes added to their parameters, and with a new drift."""
    merged = {name: dict(values) for name, values in before.items()}
    for effect, values in more.items():
        own = merged.setdefault(effect, {})
        for name, value in values.items():
            own[name] = value if effect == DRIFT else own.get(name, 0.0) + value
    return merged
