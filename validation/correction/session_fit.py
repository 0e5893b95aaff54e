r"""Fit session and machine parameters to set-up rows.

======  ==============  ============  ================================================
symbol  code            shape         meaning
======  ==============  ============  ================================================
x       ``x``           (k,)          parameters of all sessions, then u of the machine
J       ``slopes``      (R, 6, p+r)   derivative of the readings by a session's p
                                      parameters and by u
C       ``covariance``  (k, k)        covariance of x
======  ==============  ============  ================================================

The parameters of each session (:mod:`.session_unknowns`) have a flat or a Gaussian
prior.  The parameters u of the machine (:mod:`.machine_numbers`) are common to all
sessions, with the prior N(0, k).  The ratio tau of the scatter of the readings to sigma
has the prior mean estimated by the diagnosis, with 20 degrees of freedom. All rows of a
configuration together have the weight of a single row.

The factor k is chosen by cross-validation, in which each configuration of the set-up
rows is predicted by a fit to the other configurations.  A larger k is chosen only if
the decrease of the squared prediction error exceeds its standard error and 3 % of the
noise variance.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.effects.registration import BASE
from forcefit.assembly.measurement.conditions import Conditions
from forcefit.assembly.measurement.predict import predict
from forcefit.assembly.model.robot import Robot
from forcefit.validation.campaign.campaign import Campaign
from forcefit.validation.correction.machine_numbers import MachineNumbers, unchanging
from forcefit.validation.correction.session_unknowns import (
    SessionUnknowns,
    without_session,
)
from forcefit.validation.correction.spread import number_slopes
from forcefit.validation.diagnosis.gaussian import leave_block_out, marginalise, scale
from forcefit.validation.diagnosis.prediction import finite_conditions
from forcefit.validation.diagnosis.registration import coarse_frame
from forcefit.validation.diagnosis.separability import orthonormal_basis

_STEPS = 8
_SETTLED = 1e-3  # largest step of x at convergence, in standard deviations
_WIDENED = 4.0 ** np.arange(8)  # candidate values of k, the factor on the covariance
_SURE = 1.0  # smallest decrease of the squared prediction error, in standard errors
# [-] Smallest decrease of the squared prediction error, over the noise variance.
_MATTERS = 0.03
_AT_ONCE = 1000  # number of rows processed together, which limits memory


@dataclass(frozen=True, eq=False)
class SetUp:
    """A session of R rows, some of which are set-up rows.

    Attributes:
        campaign: the rows, with the saved robot.
        rows: (R,) bool, True for set-up rows.
        unknowns: parameters of the session.
    """

    campaign: Campaign
    rows: NDArray
    unknowns: SessionUnknowns

    @cached_property
    def own(self) -> Campaign:
        """Campaign that contains only the set-up rows."""
        return self.campaign.take(self.rows)

    @property
    def repeated(self) -> float:
        """Average number of set-up rows per configuration."""
        return len(self.own) / len(np.unique(self.own.configuration))

    @property
    def told(self) -> float:
        """Variance of a reading divided by sigma^2, times the number of repeats."""
        left = self.campaign.robot.diagnosis.get("normalised")
        level = max(1.0, left) if isinstance(left, float) else 1.0
        return level**2 * self.repeated

    def start(self) -> NDArray:
        """Return start values of the session's parameters, (p,)."""
        x = self.unknowns.mean.copy()
        if any(name in BASE for _, name in self.unknowns.names):
            conditions = self._still(self.campaign.robot, self.rows)
            start = coarse_frame(self.own, conditions)
            x += [start.get(name, 0.0) for _, name in self.unknowns.names]
        return x

    def _still(self, robot: Robot, rows: NDArray) -> Conditions:
        """Return the conditions of selected rows without the effects of the session."""
        bare = replace(self.campaign, robot=without_session(robot))
        return finite_conditions(bare, rows)

    def read(self, robot: Robot, values: NDArray) -> NDArray:
        """Return the predicted readings of all rows, (R, 6) [rad, m]."""
        still = self._still(robot, np.arange(len(self.campaign)))
        return predict(self.unknowns.applied(still, values)).deviation

    def tangent(
        self, machine: MachineNumbers, values: NDArray, u: NDArray, rows: NDArray
    ) -> tuple[NDArray, NDArray]:
        """Return the predicted readings of selected rows and their derivatives.

        Args:
            machine: parameters of the robot.
            values: (p,) values of the session's parameters.
            u: (r,) changes of the machine.
            rows: mask (R,) or indices of N rows.

        Returns:
            The readings (N, 6) [rad, m], and their derivatives by ``values`` and ``u``,
            (N, 6, p + r).
        """
        robot, unknowns = machine.robot_at(u), self.unknowns
        still = self._still(robot, rows)
        conditions = unknowns.applied(still, values)
        middle = predict(conditions).deviation
        slopes = np.empty((*middle.shape, len(values) + len(machine)))
        for k in range(len(values)):
            moved = values.copy()
            moved[k] += unknowns.step[k]
            there = predict(unknowns.applied(still, moved)).deviation
            slopes[:, :, k] = (there - middle) / unknowns.step[k]
        if len(machine):
            J = number_slopes(
                robot, conditions, machine.numbers, machine.std,
                lambda other: unknowns.applied(self._still(other, rows), values),
            )  # fmt: skip
            slopes[:, :, len(values) :] = J @ machine.root
        return middle, slopes

    def whitened(
        self, machine: MachineNumbers, values: NDArray, u: NDArray
    ) -> tuple[NDArray, NDArray]:
        """Return residuals (n,) and derivatives (n, p + r), divided by sigma."""
        own = self.own
        read, slopes = self.tangent(machine, values, u, self.rows)
        A = (slopes / own.sigma[:, :, None])[own.cells]
        return ((own.measured - read) / own.sigma)[own.cells], A


@dataclass(frozen=True, eq=False)
class SessionsFit:
    """Fitted session and machine parameters.

    Attributes:
        sessions: the m sessions.
        machine: parameters of the robot.
        x: (k,) parameters of all sessions, followed by u of the machine.
        covariance: (k, k) covariance of x.
        widened: factor k by which the covariance of the machine's parameters is
            multiplied.
        held: session parameters that are fitted with the machine's saved parameters.
    """

    sessions: tuple[SetUp, ...]
    machine: MachineNumbers
    x: NDArray
    covariance: NDArray
    widened: float
    held: NDArray

    @property
    def u(self) -> NDArray:
        """Independent variables u of the changes of the machine, (r,)."""
        return self.x[len(self.x) - len(self.machine) :]

    @property
    def robot(self) -> Robot:
        """Robot with the fitted parameters."""
        return self.machine.robot_at(self.u)

    def own(self, number: int) -> slice:
        """Return the slice of ``x`` that contains the parameters of a session."""
        return _own(self.sessions, number)

    def values(self, number: int) -> NDArray:
        """Return the fitted parameters of a session, (p,)."""
        return self.x[self.own(number)]

    def spread(self, number: int, cells: NDArray) -> tuple[float, NDArray]:
        """Return the mean variance of a session's readings due to the uncertainty of x.

        Args:
            number: index of the session.
            cells: (R, 6) mask of the readings to average over.

        Returns:
            The mean variance, and the contributions of each session parameter and of u,
            (p + 1,).
        """
        one, own = self.sessions[number], self.own(number)
        p, u = own.stop - own.start, slice(len(self.x) - len(self.machine), len(self.x))
        both = np.r_[own, u]
        C, total, blame = self.covariance[np.ix_(both, both)], 0.0, np.zeros(p + 1)
        rows = np.flatnonzero(cells.any(axis=1))
        for begin in range(0, len(rows), _AT_ONCE):
            some = rows[begin : begin + _AT_ONCE]
            J = one.tangent(self.machine, self.values(number), self.u, some)[1]
            J = J[cells[some]]
            total += float(np.einsum("nk,nk->", J @ C, J))
            blame[:p] += np.diag(C)[:p] * (J[:, :p] ** 2).sum(axis=0)
            blame[p] += float(np.einsum("nk,nk->", J[:, p:] @ C[p:, p:], J[:, p:]))
        return total / max(cells.sum(), 1), blame / max(cells.sum(), 1)


def _own(sessions: Sequence[SetUp], number: int) -> slice:
    """Return the slice of ``x`` that contains the parameters of a session."""
    begin = sum(len(one.unknowns) for one in sessions[:number])
    return slice(begin, begin + len(sessions[number].unknowns))


def fit_sessions(sessions: Sequence[SetUp], machine: MachineNumbers) -> SessionsFit:
    """Fit session and machine parameters to the set-up rows.

    Args:
        sessions: sessions of one robot.
        machine: parameters of the robot.

    Returns:
        The most probable values.
    """
    told = [one.told for one in sessions]
    x = np.concatenate([np.zeros(0), *(one.start() for one in sessions)])
    held, _ = _settled(sessions, unchanging(machine.robot), x, told, 1.0)
    widened, tau = _widened(sessions, machine, held, told)
    told = [max(one.told * tau**2, one.repeated) for one in sessions]
    x, C = _settled(
        sessions, machine, np.append(held, np.zeros(len(machine))), told, widened
    )
    return SessionsFit(tuple(sessions), machine, x, C, widened, held)


def _settled(
    sessions: Sequence[SetUp], machine: MachineNumbers, x: NDArray,
    told: Sequence[float], widened: float,
) -> tuple[NDArray, NDArray]:  # fmt: skip
    """Return the most probable parameters x (k,) and their covariance (k, k)."""
    begin = len(x) - len(machine)
    mean = np.concatenate([
        *(s.unknowns.mean for s in sessions),
        np.zeros(len(machine)),
    ])
    prior = [*(s.unknowns.prior for s in sessions), np.full(len(machine), 1 / widened)]
    precision = np.concatenate(prior)
    C = np.zeros((len(x), len(x)))
    for _ in range(_STEPS):
        H, g = np.diag(precision), -precision * (x - mean)
        for k, one in enumerate(sessions):
            own = np.r_[_own(sessions, k), begin : len(x)]
            z, A = one.whitened(machine, x[_own(sessions, k)], x[begin:])
            H[np.ix_(own, own)] += A.T @ A / told[k]
            g[own] += A.T @ z / told[k]
        C = _inverse(H)
        step = C @ g
        x = x + step
        if np.all(np.abs(step) <= _SETTLED * np.sqrt(np.diag(C))):
            break
    return x, C


def _inverse(H: NDArray) -> NDArray:
    """Return the (pseudo-)inverse of the information matrix H."""
    size = np.sqrt(np.diag(H))
    unit = np.where(size > 0, size, 1.0)
    scaled = H / np.outer(unit, unit) + 1e-14 * np.eye(len(H))
    return np.linalg.inv(scaled) / np.outer(unit, unit)


def _widened(
    sessions: Sequence[SetUp], machine: MachineNumbers, x: NDArray,
    told: Sequence[float],
) -> tuple[float, float]:  # fmt: skip
    """Return the factor k of the prior covariance, and the noise scale tau."""
    values = sum(len(one.unknowns) for one in sessions)
    zs, rows = [], []
    for k, one in enumerate(sessions):
        z, A = one.whitened(machine, x[_own(sessions, k)], np.zeros(len(machine)))
        wide = np.zeros((len(z), values + len(machine)))
        wide[:, np.r_[_own(sessions, k), values : wide.shape[1]]] = A
        zs.append(z / np.sqrt(told[k]))
        rows.append(wide / np.sqrt(told[k]))
    z, A = np.concatenate(zs), np.vstack(rows)
    precision = np.concatenate([np.zeros(0), *(s.unknowns.prior for s in sessions)])
    flat = np.append(precision == 0.0, np.zeros(len(machine), dtype=bool))
    Q = orthonormal_basis(A[:, flat])
    z, A = z - Q @ (Q.T @ z), (A - Q @ (Q.T @ A))[:, ~flat]
    known = precision[precision > 0.0] ** -0.5
    blocks = np.concatenate([_blocks(sessions, k) for k in range(len(sessions))])

    def predicted(k: float) -> tuple[NDArray, float]:
        """Return the sum of squared prediction errors of each block, and tau."""
        std = np.append(known, np.full(len(machine), np.sqrt(k)))
        marginal = marginalise(A, std, z, Q)
        errors, _ = leave_block_out(marginal, blocks)
        tau = scale(marginal.squares, len(z) - Q.shape[1])[0]
        return np.bincount(blocks, errors**2), tau

    grid = _WIDENED.tolist() if len(machine) else [1.0]
    squares, taus = zip(*map(predicted, grid), strict=True)
    least = min(squares, key=np.sum)
    chosen = next(
        i for i, own in enumerate(squares) if not _matters(own - least, len(z))
    )
    tau = taus[chosen]
    return max(1.0, grid[chosen] * tau**2), tau


def _matters(more: NDArray, count: int) -> bool:
    """Return whether an increase of the squared prediction errors is significant."""
    error = float(more.std(ddof=1)) * np.sqrt(len(more)) if len(more) > 1 else 0.0
    return bool(more.sum() > max(_SURE * error, _MATTERS * count))


def _blocks(sessions: Sequence[SetUp], number: int) -> NDArray:
    """Return the configuration index of each set-up reading in all sessions, (n,)."""
    before = sum(len(np.unique(s.own.configuration)) for s in sessions[:number])
    own = sessions[number].own
    rows = np.nonzero(own.cells)[0]
    return before + np.unique(own.configuration, return_inverse=True)[1][rows]
