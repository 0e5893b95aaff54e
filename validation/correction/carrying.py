r"""A saved robot in a new session: what belongs to the session from set-up rows.

Of a session are where the measuring device stands and, if asked for, the measured point
and the zeros of the joints; everything else is the robot's.  They are fitted to the
set-up rows of each session, and judged on all its other rows.

======  =============  =========  ====================================================
symbol  code           shape      meaning
======  =============  =========  ====================================================
x       ``values``     (k,)       what is fitted to a session
J       ``slopes``     (R,6,k)    change of the readings per unit of it
C       ``covariance`` (k, k)     of the values
======  =============  =========  ====================================================

The covariance grows with what the set-up rows leave unexplained, and as if rows of one
configuration told the same.  Where it lets the other rows move by more than the set-up
rows are off, the set-up rows do not suffice.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assembly.effects import LIBRARY, apply_effects
from assembly.effects.registration import BASE, TOOL
from assembly.measurement.conditions import Conditions
from assembly.measurement.predict import predict
from assembly.model.robot import Robot
from forcefit.inputs.display import html_table, short_repr
from forcefit.inputs.errors import BadInput, nearest, quoted
from validation.campaign.campaign import Campaign
from validation.correction.prediction import error_of, finite_conditions
from validation.diagnosis.registration import coarse_frame

OF_A_SESSION = ("registration", "tool", "zeros")
_ZERO = 1e-3  # [rad, m] standard deviation of a zero that was set anew
_STEPS = 8
_STEP = 1e-6  # [rad, m] for slopes
_SETTLED = 1e-3  # [sigma of the value] a step that changes nothing


@dataclass(frozen=True, eq=False)
class Carried:
    """One session.

    Attributes:
        session: its name, None where the campaign has but one.
        names: of the k values: effect and parameter.
        values: (k,) [rad, m].
        std: (k,) of them.
        rows: numbers of set-up rows and of others.
        error: (3,) rms over the other rows: position [m], rotation [rad], in sigma.
        declared: (3,) the same of the campaign's own robot, fitted alike.
        uncertainty: [m] by which the set-up rows leave the other rows' points open,
            rms.
        left: [m] rms of what they leave unexplained in themselves.
        open_: names of the values that are known least, if they do not suffice.
    """

    session: str | None
    names: tuple[tuple[str, str], ...]
    values: NDArray
    std: NDArray
    rows: tuple[int, int]
    error: NDArray
    declared: NDArray
    uncertainty: float
    left: float
    open_: tuple[str, ...]

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

    @property
    def effects(self) -> dict[str, dict[str, float]]:
        """What was fitted, by effect."""
        values: dict[str, dict[str, float]] = {}
        for (effect, name), value in zip(self.names, self.values.tolist(), strict=True):
            values.setdefault(effect, {})[name] = value
        return values


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
        own = replace(campaign.take(of_it), robot=_unregistered(campaign.robot))
        answers.append(_carried(own, declared.take(of_it), chosen, fitted, session))
    return answers


def carried_robot(robot: Robot, carried: Sequence[Carried]) -> Robot:
    """The robot with what was found of its sessions, its old registration gone."""
    robot = _unregistered(robot)
    for one in carried:
        if one.session is None:
            merged = _added(robot.effects, one.effects)
            robot = replace(robot, effects=merged)
        else:
            before = robot.session_effects.get(one.session, {})
            sessions = {
                **robot.session_effects,
                one.session: _added(before, one.effects),
            }
            robot = replace(robot, session_effects=sessions)
    return robot


def _added(before: Any, more: dict[str, dict[str, float]]) -> dict[str, Any]:
    """Effects with more added to their parameters; these are all sums."""
    merged = {name: dict(values) for name, values in before.items()}
    for effect, values in more.items():
        own = merged.setdefault(effect, {})
        for name, value in values.items():
            own[name] = own.get(name, 0.0) + value
    return merged


def _unregistered(robot: Robot) -> Robot:
    """The robot without the device's place, which is of the session it was found in."""
    effects = {name: dict(values) for name, values in robot.effects.items()}
    tool = {k: v for k, v in effects.pop("registration", {}).items() if k in TOOL}
    if tool:
        effects["registration"] = tool
    return replace(robot, effects=effects)


def _carried(
    campaign: Campaign, declared: Campaign, setup: NDArray, fitted: Sequence[str],
    session: str | None,
) -> Carried:  # fmt: skip
    """One session, its rows alone."""
    names, prior = _names(campaign.robot, fitted)
    fit = _fitted(campaign, setup, names, prior)
    other = _fitted(declared, setup, names, prior)
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
        open_ = tuple(names[k][1] for k in worst)
    return Carried(
        session=session,
        names=tuple(names),
        values=fit.values,
        std=np.sqrt(np.diag(fit.covariance)),
        rows=(int(setup.sum()), int((~setup).sum())),
        error=error_of(rest, fit.deviation[~setup]),
        declared=error_of(declared.take(~setup), other.deviation[~setup]),
        uncertainty=uncertainty,
        left=left,
        open_=open_,
    )


def _names(
    robot: Robot, fitted: Sequence[str]
) -> tuple[list[tuple[str, str]], NDArray]:  # fmt: skip
    """Parameters to be fitted, and (k,) 1 / variance of what is known of them."""
    names: list[tuple[str, str]] = []
    if "registration" in fitted:
        names += [("registration", name) for name in BASE]
    if "tool" in fitted:
        names += [("registration", name) for name in TOOL]
    places = LIBRARY["encoder_offset"].frames
    assert places is not None
    zeros = [("encoder_offset", n) for n in places(robot)] if "zeros" in fitted else []
    prior = np.r_[np.zeros(len(names)), np.full(len(zeros), _ZERO**-2)]
    return names + zeros, prior


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
    campaign: Campaign, setup: NDArray, names: list[tuple[str, str]], prior: NDArray
) -> _SessionFit:
    """Gauss-Newton's method on the set-up rows."""
    conditions = finite_conditions(campaign)
    x = np.zeros(len(names))
    registered = any(name in BASE for _, name in names)
    if registered:
        start = coarse_frame(campaign.take(setup), conditions.take(setup))
        x = np.array([start.get(name, 0.0) for _, name in names])
    cells = campaign.cells & setup[:, None]
    sigma = campaign.sigma
    for _ in range(_STEPS):
        deviation, slopes = _tangent(conditions, names, x)
        A = (slopes / sigma[:, :, None])[cells]
        b = ((campaign.measured - deviation) / sigma)[cells]
        size = np.linalg.norm(A, axis=0)
        unit = np.where(size > 0, size, 1.0)
        H = (A / unit).T @ (A / unit) + np.diag(prior / unit**2)
        H += 1e-14 * np.eye(len(x))  # a direction that nothing tells stays finite
        inverse = np.linalg.inv(H) / np.outer(unit, unit)
        step = inverse @ (A.T @ b - prior * x)
        x = x + step
        if np.all(np.abs(step) <= _SETTLED * np.sqrt(np.diag(inverse))):
            break
    deviation, slopes = _tangent(conditions, names, x)
    b = ((campaign.measured - deviation) / sigma)[cells]
    excess = max(1.0, float(b @ b) / max(len(b) - len(x), 1))
    distinct = len(np.unique(campaign.configuration[setup]))
    alike = float(setup.sum()) / distinct
    return _SessionFit(x, inverse * excess * alike, slopes, deviation)


def _tangent(
    conditions: Conditions, names: list[tuple[str, str]], x: NDArray
) -> tuple[NDArray, NDArray]:
    """(R, 6) readings foretold with values, and their (R, 6, k) slopes."""

    def read(values: NDArray) -> NDArray:
        effects: dict[str, dict[str, float]] = {}
        for (effect, name), value in zip(names, values.tolist(), strict=True):
            effects.setdefault(effect, {})[name] = value
        return predict(apply_effects(conditions, effects)).deviation

    middle = read(x)
    slopes = np.empty((*middle.shape, len(x)))
    for k in range(len(x)):
        moved = x.copy()
        moved[k] += _STEP
        slopes[:, :, k] = (read(moved) - middle) / _STEP
    return middle, slopes


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
