r"""Whiten noise that is common to the points of a measurement.

One measurement may contain several points of the platform.  The noise of its readings,
divided by the declared sigma, is e + L n.  Here e is independent noise with variance
1/w, and n contains k standard normal variables that are common to all readings of the
measurement.

======  ===============  =======  ====================================================
symbol  code             shape    meaning
======  ===============  =======  ====================================================
w       ``root`` ** 2    (n,)     relative precisions
L       ``loadings``     (n, k)   change of the readings / sigma per common variable
W       ``matrix``       (n, n)   block-diagonal, W (w^-1 + L L') W' = 1
======  ===============  =======  ====================================================

The matrix is W = (1 + K K')^-1/2 w^1/2 with K = w^1/2 L. It is computed from the
singular values of the blocks of K.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array
from scipy.sparse.linalg import spsolve

from forcefit.validation.campaign.campaign import Campaign


@dataclass(frozen=True, eq=False)
class Whitening:
    """Linear map of n readings to values with independent noise of unit variance.

    Attributes:
        root: (n,) square roots of the relative precisions.
        matrix: (n, n) sparse matrix W, None without common noise.
        log_det: ln det (1 + K K').
    """

    root: NDArray
    matrix: csc_array | None = None
    log_det: float = 0.0

    def __call__(self, values: NDArray) -> NDArray:
        """Return W times values (n,) or (n, m), which are divided by sigma."""
        if self.matrix is not None:
            return np.asarray(self.matrix @ values)
        return values * (self.root if values.ndim == 1 else self.root[:, None])

    def inverse(self, values: NDArray) -> NDArray:
        """Undo the transformation of values (n,)."""
        if self.matrix is not None:
            return np.asarray(spsolve(self.matrix, values))
        return values / self.root


def whitening(root: NDArray, loadings: NDArray | None, visit: NDArray) -> Whitening:
    """Return the whitening transformation of n readings.

    Args:
        root: (n,) square roots of the relative precisions.
        loadings: (n, k) changes of the readings, divided by sigma, per common variable.
            None without common noise.
        visit: (n,) index of the measurement of each reading.
    """
    if loadings is None or not loadings.any():
        return Whitening(root)
    K = root[:, None] * loadings
    row, column, value, log_det = [], [], [], 0.0
    for cells in _of_one_size(visit):
        U, d, _ = np.linalg.svd(K[cells], full_matrices=False)
        shrink = 1 / np.sqrt(1 + d**2) - 1
        W = np.eye(cells.shape[1]) + (U * shrink[:, None]) @ U.transpose(0, 2, 1)
        W *= root[cells][:, None, :]
        row.append(np.broadcast_to(cells[:, :, None], W.shape).ravel())
        column.append(np.broadcast_to(cells[:, None, :], W.shape).ravel())
        value.append(W.ravel())
        log_det += float(np.log1p(d**2).sum())
    places = np.concatenate(row), np.concatenate(column)
    matrix = csc_array((np.concatenate(value), places), shape=(len(root), len(root)))
    return Whitening(root, matrix, log_det)


def _of_one_size(visit: NDArray) -> Iterator[NDArray]:
    """Yield the indices of the readings of all measurements with m readings, (V, m)."""
    order = np.argsort(visit, kind="stable")
    _, start, count = np.unique(visit[order], return_index=True, return_counts=True)
    for size in np.unique(count).tolist():
        first = start[count == size]
        yield order[first[:, None] + np.arange(size)]


def whitening_of(campaign: Campaign, cells: NDArray) -> Whitening:
    """Return the whitening transformation of readings selected by a mask (R, 6)."""
    row, _ = np.nonzero(cells)
    loadings = None
    if campaign.common is not None:
        loadings = campaign.common[cells] / campaign.sigma[cells][:, None]
    visit = campaign.measured_at_once[row] if loadings is not None else row
    return whitening(np.ones(len(row)), loadings, visit)


def independent(campaign: Campaign, residual: NDArray) -> NDArray:
    """Return the whitened values (N,) of a residual (R, 6) [rad, m].

    Values that are not finite are replaced by zero.
    """
    cells = campaign.cells
    z = np.nan_to_num(residual[cells] / campaign.sigma[cells])
    return whitening_of(campaign, cells)(z)


def size_of_noise(campaign: Campaign) -> NDArray:
    """Return the standard deviations (R, 6) [rad, m] including common noise."""
    if campaign.common is None:
        return campaign.sigma
    return np.sqrt(campaign.sigma**2 + np.sum(campaign.common**2, axis=2))


def platform_motions(campaign: Campaign, reading: NDArray) -> NDArray | None:
    """Return the change of the readings due to small motions of the platform.

    Args:
        campaign: campaign of R rows.
        reading: (R, 6, 6) change of the readings per unit platform screw at the
            platform origin, base axes.

    Returns:
        (R, 6, 6) [rad, m] change per unit rotation about the centre of the measured
        points and per unit translation.  None if every measurement contains a single
        point.
    """
    visit = campaign.measured_at_once[campaign.cells.any(axis=1)]
    if len(np.unique(visit)) == len(visit):
        return None
    centre = np.unique(campaign.targets, axis=0).mean(axis=0)
    place = campaign.transforms[:, campaign.robot.index(campaign.robot.platform)]
    # Rows of these matrices are screw components, and columns are motions.
    screws = np.tile(np.eye(6), (len(campaign), 1, 1))
    arm = place[:, :3, :3] @ centre
    screws[:, 3:, :3] = np.swapaxes(np.cross(np.eye(3), -arm[:, None]), 1, 2)
    return np.asarray(reading @ screws)
