"""Estimate the noise of machine and measuring device from repeated measurements.

Rows with the same configuration and load form a set. Deviations from the mean of a set
contain noise and slow changes. The slow changes with time, temperature and direction of
approach are fitted to all sets together and subtracted.

======  ============  ======  ========================================================
symbol  code          shape   meaning
======  ============  ======  ========================================================
z       ``whitened``  (N,)    readings / declared sigma, row by row
B       ``slow``      (N, p)  changes of the readings per coefficient / sigma
x                     (p,)    coefficients of the slow changes
e       ``rest``      (N,)    z minus the mean of the set and minus the fitted B x
h       ``leverage``  (N,)    weight of a reading in its fitted value
======  ============  ======  ========================================================

Sources:
    Cook, Weisberg (1982), Residuals and influence in regression.  The deleted residual
    e / (s sqrt(1 - h)), with s computed without the tested reading, has Student's t
    distribution. The largest of N residuals is tested with Bonferroni's bound.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray
from scipy.stats import chi2, f, t

from forcefit.validation.campaign.campaign import READING, Campaign
from forcefit.validation.diagnosis.separability import orthonormal_basis
from forcefit.validation.inspection.measuring_order import session_clock

_LEVEL = 0.01  # probability of at least one suspect in a campaign without blunders
MOST = 20  # largest number of suspects


@dataclass(frozen=True)
class Suspect:
    """A reading that deviates too much from its repeats.

    Attributes:
        rows: row of the reading. If the set contains two rows, both rows are listed.
        component: component of the reading.
        size: [-] deleted residual (Student's t).
        chance: probability that noise alone causes such a large residual in the
            campaign.
    """

    rows: tuple[int, ...]
    component: str
    size: float
    chance: float


@dataclass(frozen=True, eq=False)
class RepeatNoise:
    """Noise estimated from repeats, with 90 % confidence intervals.

    Attributes:
        ratio: [-] standard deviation divided by the declared sigma, pooled over all
            components.
        degrees: degrees of freedom of the ratio.
        interval: confidence interval of the ratio.
        plain: the ratio without subtraction of slow changes.
        taken_out: mapping from each slow change to the probability that noise alone
            causes such a large change.
        component: (6,) [rad, m] standard deviations, NaN for components without
            repeats.
        component_degrees: (6,) degrees of freedom.
        component_interval: (6, 2) [rad, m] confidence intervals.
        suspects: readings that deviate too much from their repeats.  They are excluded
            from all estimates.
    """

    ratio: float
    degrees: int
    interval: tuple[float, float]
    plain: float
    taken_out: dict[str, float]
    component: NDArray
    component_degrees: NDArray
    component_interval: NDArray
    suspects: tuple[Suspect, ...]


def repeat_noise(
    campaign: Campaign, slow: Mapping[str, NDArray] | None = None
) -> RepeatNoise | None:
    """Return the noise estimated from repeats, or None without repeats.

    Slow changes are subtracted if enough degrees of freedom remain.

    Args:
        campaign: campaign with N readings.
        slow: mapping from the name of each slow change to its design matrix (N, p),
            divided by sigma.  None for the result of :func:`slow_changes`.
    """
    slow = slow_changes(campaign) if slow is None else slow
    suspects: list[Suspect] = []
    out: set[int] = set()
    while True:
        cells = _repeated_cells(campaign, out)
        if not cells.any():
            return None
        fit = _RepeatFit(campaign, cells, slow)
        suspect = fit.suspect()
        if suspect is None or len(suspects) == MOST:
            return fit.noise(suspects)
        suspects.append(suspect)
        out.update(suspect.rows)


def slow_changes(campaign: Campaign) -> dict[str, NDArray]:
    """Return design matrices of slow changes that do not depend on the configuration.

    Args:
        campaign: campaign with N readings.

    Returns:
        Mapping from the name of each change to its design matrix (N, p), divided by
        sigma. Changes with time are an exponential and a cubic polynomial.  Changes
        with temperature and direction of approach are linear.  If no time was recorded,
        rows are assumed to be equally spaced in time.
    """
    clock = 2 * session_clock(campaign) - 1
    shapes = {
        "time": np.column_stack([
            np.exp(-5 * (clock + 1)),
            legendre.legvander(clock, 3)[:, 1:],
        ])
    }
    for name in ("temperature", "approach"):
        values = campaign.covariates.get(name, np.zeros(len(campaign)))
        if np.ptp(values) > 0:
            shapes[name] = (values - values.mean())[:, None] / np.ptp(values)
    return {name: for_each_component(campaign, v) for name, v in shapes.items()}


def for_each_component(campaign: Campaign, shapes: NDArray) -> NDArray:
    """Return a design matrix (N, 6 p) / sigma with separate changes per component.

    Args:
        campaign: campaign of R rows with N readings.
        shapes: (R, p) value of each change in each row.
    """
    cells = campaign.cells
    row, component = np.nonzero(cells)
    apart = np.eye(6)[component] / campaign.sigma[cells][:, None]
    return (shapes[row][:, :, None] * apart[:, None, :]).reshape(len(row), -1)


def _sets(campaign: Campaign) -> NDArray:
    """Return the index (N,) of the set of repeats to which each reading belongs."""
    row, component = np.nonzero(campaign.cells)
    return campaign.repeat[row] * 6 + component


def _repeated_cells(campaign: Campaign, out: set[int]) -> NDArray:
    """Return a mask (N,) of repeated readings, without the rows in ``out``."""
    row, _ = np.nonzero(campaign.cells)
    kept = ~np.isin(row, list(out))
    sets = _sets(campaign)
    count = np.bincount(sets[kept], minlength=sets.max(initial=0) + 1)
    return kept & (count[sets] > 1)


class _RepeatFit:
    """Least-squares fit of set means and slow changes to repeated readings."""

    def __init__(
        self, campaign: Campaign, cells: NDArray, slow: Mapping[str, NDArray]
    ) -> None:
        row, component = np.nonzero(campaign.cells)
        self.row, self.component = row[cells], component[cells]
        self.campaign = campaign
        self.sigma = campaign.sigma[campaign.cells][cells]
        _, self.set = np.unique(_sets(campaign)[cells], return_inverse=True)
        self.count = np.bincount(self.set)
        self.z = self._centred(
            campaign.measured[campaign.cells][cells][:, None] / self.sigma[:, None]
        )[:, 0]
        self.plain_degrees = int((self.count - 1).sum())
        self.slow = {name: self._centred(B[cells]) for name, B in slow.items()}
        self.basis = _basis(self.slow.values(), len(self.z))
        if self.basis.shape[1] > self.plain_degrees / 2:
            self.slow, self.basis = {}, np.zeros((len(self.z), 0))
        self.degrees = self.plain_degrees - self.basis.shape[1]
        self.rest = self.z - self.basis @ (self.basis.T @ self.z)
        self.leverage = 1 / self.count[self.set] + (self.basis**2).sum(axis=1)
        self.rss = float(self.rest @ self.rest)

    def _centred(self, columns: NDArray) -> NDArray:
        """Subtract the mean over each set of repeats from each column."""
        sums = np.zeros((len(self.count), columns.shape[1]))
        np.add.at(sums, self.set, columns)
        return columns - (sums / self.count[:, None])[self.set]

    def suspect(self) -> Suspect | None:
        """Return the reading with the largest deviation, or None if it is plausible."""
        if self.degrees < 2 or self.rss == 0.0:
            return None
        free = np.maximum(1 - self.leverage, 1e-12)
        others = np.maximum(self.rss - self.rest**2 / free, 1e-300)
        size = self.rest * np.sqrt((self.degrees - 1) / (others * free))
        i = int(np.argmax(np.abs(size)))
        chance = float(2 * t.sf(abs(size[i]), self.degrees - 1) * len(size))
        if chance >= _LEVEL:
            return None
        pair = self.count[self.set[i]] == 2
        rows = self.row[self.set == self.set[i]] if pair else self.row[[i]]
        return Suspect(
            tuple(rows.tolist()), READING[self.component[i]], float(size[i]), chance
        )

    def noise(self, suspects: list[Suspect]) -> RepeatNoise:
        """Return the noise estimated from the repeats."""
        free, rest = 1 - self.leverage, self.rest**2
        degrees = np.bincount(self.component, free, 6)
        cells = np.maximum(np.bincount(self.component, minlength=6), 1)
        size = np.bincount(self.component, self.sigma**2, 6) / cells
        with np.errstate(invalid="ignore", divide="ignore"):
            ratio = np.sqrt(np.bincount(self.component, rest, 6) / degrees)
            known = degrees > 0.5
            component = np.where(known, ratio * np.sqrt(size), np.nan)
        factors = np.array([
            _interval(d) if d > 0.5 else (np.nan,) * 2 for d in degrees
        ])
        whole = np.sqrt(self.rss / self.degrees)
        low, high = _interval(self.degrees)
        return RepeatNoise(
            ratio=float(whole),
            degrees=self.degrees,
            interval=(float(whole * low), float(whole * high)),
            plain=float(np.sqrt(self.z @ self.z / self.plain_degrees)),
            taken_out={name: self._chance(name) for name in self.slow},
            component=component,
            component_degrees=np.where(known, degrees, 0.0),
            component_interval=component[:, None] * factors,
            suspects=tuple(suspects),
        )

    def _chance(self, name: str) -> float:
        """Return the p-value of a slow change."""
        others = [B for key, B in self.slow.items() if key != name]
        basis = _basis(others, len(self.z))
        rest = self.z - basis @ (basis.T @ self.z)
        more = self.basis.shape[1] - basis.shape[1]
        if more == 0 or self.rss == 0.0:
            return 1.0
        size = (float(rest @ rest) - self.rss) / more / (self.rss / self.degrees)
        return float(f.sf(size, more, self.degrees))


def _basis(blocks: Iterable[NDArray], rows: int) -> NDArray:
    """Return an orthonormal basis (rows, rank) of the columns of all matrices."""
    return orthonormal_basis(np.column_stack([np.zeros((rows, 0)), *blocks]))


def _interval(degrees: float) -> tuple[float, float]:
    """Return the 90 % confidence interval of a standard deviation over its estimate."""
    low, high = chi2.ppf([0.05, 0.95], degrees)
    return float(np.sqrt(degrees / high)), float(np.sqrt(degrees / low))
