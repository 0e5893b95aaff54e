r"""A saved robot in a new session: what belongs to the session from set-up rows.

Of a session are where the measuring device stands, what changed with time and, if asked
for, the measured point and the zeros of the joints (:mod:`.session_unknowns`);
everything else is the robot's.  They are fitted to the set-up rows of each session, and
judged on all its other rows.

======  =============  =========  ====================================================
symbol  code           shape      meaning
======  =============  =========  ====================================================
x       ``values``     (k,)       what is fitted to a session
J       ``slopes``     (R,6,k)    change of the readings per unit of it
C       ``covariance`` (k, k)     of the values
======  =============  =========  ====================================================

The set-up rows weigh less, and the covariance grows, with what they leave unexplained,
and as if rows of one configuration told the same.  Where the covariance lets the other
rows move by more than the set-up rows are off, the set-up rows do not suffice.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assembly.effects.registration import BASE
from assembly.measurement.conditions import Conditions
from assembly.measurement.predict import predict
from assembly.model.robot import Robot
from forcefit.inputs.display import html_table, short_repr
from forcefit.inputs.errors import BadInput, nearest, quoted
from validation.campaign.campaign import Campaign
from validation.correction.prediction import error_of
from validation.correction.session_unknowns import (
    DRIFT,
    SessionUnknowns,
    of_one_session,
    session_unknowns,
    without_session,
)
from validation.diagnosis.prediction import finite_conditions
from validation.diagnosis.registration import coarse_frame

_STEPS = 8
_SETTLED = 1e-3  # [sigma of the value] a step that changes nothing


@dataclass(frozen=True, eq=False)
class Carried:
    """One session.

    Attributes:
        session: its name, None where the campaign has but one.
        unknowns: the k values that were fitted.
        values: (k,) [rad, m].
        std: (k,) of them.
        rows: numbers of set-up rows and of others.
        error: (3,) rms over the other rows: position [m], rotation [rad], in sigma.
        declared: (3,) the same of the campaign's own robot, fitted alike.
        uncertainty: [m] by which the set-up rows leave the other rows' points open,
            rms.
        left: [m] rms of what they leave unexplained in themselves.
        open_: names of the values that are known least, if they do not suffice.
        left_behind: what changed with time where the robot was learned, and is not
            fitted here: without a clock nobody can say how it goes on.
    """

    session: str | None
    unknowns: SessionUnknowns
    values: NDArray
    std: NDArray
    rows: tuple[int, int]
    error: NDArray
    declared: NDArray
    uncertainty: float
    left: float
    open_: tuple[str, ...]
    left_behind: tuple[str, ...]

    __repr__, _repr_html_ = short_repr, html_table

    @property
    def suffices(self) -> bool:
        """Whether the set-up rows do."""
        return not self.open_

    @property
    def better(self) -> bool:
        """Whether the robot foretells the other rows better than the declared one."""
        known = np.isfinite(self.declared)
        return bool(np.all(self.error[known][-1:] <= self.declared[known][-1:]))


def carry(
    campaign: Campaign,
    declared: Campaign,
    setup: NDArray,
    fitted: Sequence[str] = ("registration",),
) -> list[Carried]:
    """Fit what belongs to the sessions of a campaign, and judge the rest.

    Args:
        campaign: of the saved robot.
        declared: the same rows with the campaign's own robot.
        setup: (R,) bool, the set-up rows.
        fitted: of :data:`OF_A_SESSION`.

    Returns:
        Every session.

    Raises:
        BadInput: a session has no set-up rows, or nothing but them.
    """
    answers = []
    for session in campaign.sessions or (None,):
        of_it = np.ones(len(campaign), dtype=bool)
        if session is not None:
            of_it = np.asarray(campaign.session == session)
        chosen = setup[of_it]
        which = f"session {quoted(session)}" if session is not None else campaign.name
        if not chosen.any() or chosen.all():
            rows = "no set-up rows" if not chosen.any() else "nothing but set-up rows"
            raise BadInput(f"--setup: found {rows} in {which}; expected some, not all")
        clock = "time" in campaign.covariates
        unknowns = session_unknowns(campaign.robot, fitted, clock=clock)
        own = replace(campaign.take(of_it), robot=without_session(campaign.robot))
        one = _carried(own, declared.take(of_it), chosen, unknowns, session)
        behind = _left_behind(campaign.robot, unknowns)
        answers.append(replace(one, left_behind=behind))
    return answers


def _left_behind(robot: Robot, unknowns: SessionUnknowns) -> tuple[str, ...]:
    """Titles of what changed with time and is not among a session's unknowns."""
    drift, functions = of_one_session(robot)
    whole = [DRIFT] if drift and unknowns.constant is None else []
    return (*whole, *(f.title for f in functions if f not in unknowns.functions))


def carried_robot(robot: Robot, carried: Sequence[Carried]) -> Robot:
    """The robot with what was found of its sessions, what was of its old one gone."""
    robot = without_session(robot)
    for one in carried:
        effects = one.unknowns.effects(one.values)
        functions = one.unknowns.functions_with(one.values, one.session)
        robot = replace(robot, functions=(*robot.functions, *functions))
        if one.session is None:
            robot = replace(robot, effects=_added(robot.effects, effects))
        else:
            before = robot.session_effects.get(one.session, {})
            sessions = {**robot.session_effects, one.session: _added(before, effects)}
            robot = replace(robot, session_effects=sessions)
    return robot


def _added(before: Any, more: dict[str, dict[str, float]]) -> dict[str, Any]:
    """Effects with more added to their parameters; these are all sums but a drift's."""
    merged = {name: dict(values) for name, values in before.items()}
    for effect, values in more.items():
        own = merged.setdefault(effect, {})
        for name, value in values.items():
            own[name] = value if effect == DRIFT else own.get(name, 0.0) + value
    return merged


def _carried(
    campaign: Campaign, declared: Campaign, setup: NDArray, unknowns: SessionUnknowns,
    session: str | None,
) -> Carried:  # fmt: skip
    """One session, its rows alone."""
    fit = _fitted(campaign, setup, unknowns)
    other = _fitted(declared, setup, unknowns)
    rest = campaign.take(~setup)
    spread = np.einsum("rck,kl,rcl->rc", fit.slopes, fit.covariance, fit.slopes)
    cells = campaign.cells & ~setup[:, None]
    cells[:, :3] = False  # positions decide, unless there are none
    cells = cells if cells.any() else campaign.cells & ~setup[:, None]
    own = campaign.cells & setup[:, None]
    own[:, :3] &= not own[:, 3:].any()
    uncertainty = float(np.sqrt(np.mean(spread[cells]))) if cells.any() else 0.0
    left = float(np.sqrt(np.mean((campaign.measured - fit.deviation)[own] ** 2)))
    level = max(left, float(np.median(campaign.sigma[own])))
    open_: tuple[str, ...] = ()
    if not uncertainty <= level:
        mean = np.einsum("rck,rc->k", fit.slopes**2, cells.astype(float))
        blame = np.diag(fit.covariance) * mean
        worst = np.flatnonzero(blame > 0.1 * blame.max())
        open_ = tuple(unknowns.names[k][1] for k in worst)
    return Carried(
        session=session,
        unknowns=unknowns,
        values=fit.values,
        std=np.sqrt(np.diag(fit.covariance)),
        rows=(int(setup.sum()), int((~setup).sum())),
        error=error_of(rest, fit.deviation[~setup]),
        declared=error_of(declared.take(~setup), other.deviation[~setup]),
        uncertainty=uncertainty,
        left=left,
        open_=open_,
        left_behind=(),
    )


@dataclass(frozen=True, eq=False)
class _SessionFit:
    """Values of a session.

    Attributes:
        values: (k,).
        covariance: (k, k).
        slopes: (R, 6, k).
        deviation: (R, 6) [rad, m] foretold with them.
    """

    values: NDArray
    covariance: NDArray
    slopes: NDArray
    deviation: NDArray


def _fitted(
    campaign: Campaign, setup: NDArray, unknowns: SessionUnknowns
) -> _SessionFit:
    """Gauss-Newton's method on the set-up rows; again, with what they then weigh."""
    conditions = finite_conditions(campaign)
    x = unknowns.mean.copy()
    if any(name in BASE for _, name in unknowns.names):
        start = coarse_frame(campaign.take(setup), conditions.take(setup))
        x += [start.get(name, 0.0) for _, name in unknowns.names]
    rows = _SetUp(campaign, conditions, setup)
    fit, weight = rows.settled(unknowns, x, 1.0)
    if unknowns.prior.any() and weight < 1.0:
        fit, _ = rows.settled(unknowns, fit.values, weight)
    return fit


@dataclass(frozen=True, eq=False)
class _SetUp:
    """Set-up rows of a session of R rows, and the conditions of all.

    Attributes:
        campaign: of the session.
        conditions: of its rows, without what is fitted.
        rows: (R,) bool, the set-up rows.
    """

    campaign: Campaign
    conditions: Conditions
    rows: NDArray

    def settled(
        self, unknowns: SessionUnknowns, x: NDArray, weight: float
    ) -> tuple[_SessionFit, float]:
        """A fit from values (k,), and what the rows weigh by what it leaves."""
        campaign, prior = self.campaign, unknowns.prior
        cells, sigma = campaign.cells & self.rows[:, None], campaign.sigma
        for _ in range(_STEPS):
            deviation, slopes = self._tangent(unknowns, x)
            A = (slopes / sigma[:, :, None])[cells]
            b = ((campaign.measured - deviation) / sigma)[cells]
            inverse = _inverse(A, prior / weight)
            step = inverse @ (A.T @ b - prior / weight * (x - unknowns.mean))
            x = x + step
            if np.all(np.abs(step) <= _SETTLED * np.sqrt(np.diag(inverse))):
                break
        deviation, slopes = self._tangent(unknowns, x)
        b = ((campaign.measured - deviation) / sigma)[cells]
        excess = max(1.0, float(b @ b) / max(len(b) - len(x), 1))
        distinct = len(np.unique(campaign.configuration[self.rows]))
        told = excess * float(self.rows.sum()) / distinct
        covariance = told * _inverse(A, told * prior)
        return _SessionFit(x, covariance, slopes, deviation), 1 / told

    def _tangent(
        self, unknowns: SessionUnknowns, x: NDArray
    ) -> tuple[NDArray, NDArray]:
        """(R, 6) readings foretold with values, and their (R, 6, k) slopes."""

        def read(values: NDArray) -> NDArray:
            return predict(unknowns.applied(self.conditions, values)).deviation

        middle = read(x)
        slopes = np.empty((*middle.shape, len(x)))
        for k in range(len(x)):
            moved = x.copy()
            moved[k] += unknowns.step[k]
            slopes[:, :, k] = (read(moved) - middle) / unknowns.step[k]
        return middle, slopes


def _inverse(A: NDArray, prior: NDArray) -> NDArray:
    """(A'A + diag(prior))^-1, columns of A (N, k) brought to size one."""
    size = np.linalg.norm(A, axis=0)
    unit = np.where(size > 0, size, 1.0)
    H = (A / unit).T @ (A / unit) + np.diag(prior / unit**2)
    H += 1e-14 * np.eye(len(size))  # a direction that nothing tells stays finite
    return np.linalg.inv(H) / np.outer(unit, unit)


def setup_rows(campaign: Campaign, text: str) -> NDArray:
    """Which rows ``--setup`` names.

    Args:
        campaign: with rows in the order of the file.
        text: ``20`` for the first 20 of each session, numbers and ranges of rows such
            as ``1-20,31``, or labels.

    Returns:
        (R,) bool; all points of a row of the file together.

    Raises:
        BadInput: neither a number of rows nor rows that are there.
    """
    labels = [_label(campaign, i) for i in range(len(campaign))]
    order = list(dict.fromkeys(labels))
    parts = [part.strip() for part in text.split(",")]
    if len(parts) == 1 and parts[0].isascii() and parts[0].isdigit():
        chosen = _first(campaign, labels, int(parts[0]))
    else:
        chosen = {label for part in parts for label in _range(part, order)}
    return np.array([label in chosen for label in labels])


def _label(campaign: Campaign, row: int) -> str:
    """The label of a row in the file, the point taken off."""
    point = "" if campaign.point is None else str(campaign.point[row])
    return campaign.ids[row].removesuffix(f":{point}") if point else campaign.ids[row]


def _first(campaign: Campaign, labels: list[str], count: int) -> set[str]:
    """The first rows of every session."""
    chosen: set[str] = set()
    sessions = campaign.session
    for session in campaign.sessions or (None,):
        own = [
            label for i, label in enumerate(labels)
            if sessions is None or sessions[i] == session
        ]  # fmt: skip
        chosen |= set(list(dict.fromkeys(own))[:count])
    return chosen


def _range(part: str, order: list[str]) -> list[str]:
    """Labels of a row's number, of a range of them, or of a label."""
    if part in order:
        return [part]
    begin, dash, end = part.partition("-")
    numbers = [begin, end] if dash else [begin, begin]
    if all(n.isascii() and n.isdigit() for n in numbers):
        first, last = map(int, numbers)
        if 1 <= first <= last <= len(order):
            return order[first - 1 : last]
        raise BadInput(
            f"--setup: found {quoted(part)}, expected rows 1 to {len(order)}"
        )
    hint = nearest(part, order)
    raise BadInput(f"--setup: found {quoted(part)}, which is no row's label{hint}")
