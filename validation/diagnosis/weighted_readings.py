"""Store the weighted readings and design matrices for a linear fit."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from forcefit.validation.diagnosis.columns import Columns
from forcefit.validation.diagnosis.elements import Element
from forcefit.validation.diagnosis.prior_sizes import Eigen

NARROW = 50  # design matrices with at most this number of columns are cached
_RANK = 1e-9  # relative singular value that is treated as zero
NONE = (0.0, 0.0)  # standard deviations without common noise


class WeightedReadings:
    """Weighted readings for a linear fit, with the device pose projected out.

    Attributes:
        columns: design matrices for all N readings.
        given: (n,) whitened residual of the readings used in the fit.
        cells: (N,) mask of the readings used in the fit.
        weights: (n,) relative precisions, 1 for a reading that is not a blunder.
        common: [rad, m] standard deviations of the platform motion that is common to
            all readings of a measurement, divided by tau.
        sampled: (n,) mask of the readings on which functions are scored first.
        whiten: transformation of the fitted readings to independent noise.
        flat: (n, f) orthonormal design matrix for the pose of the measuring frame.
        z: (n,) whitened residual after projecting out the pose of the measuring frame.
        small: (n, k) design matrix of the nuisance parameters after projecting out the
            pose of the measuring frame.
        gram: (k, k) inner products of the columns of ``small``.
        count: number of readings, minus the number of projected-out columns.
    """

    def __init__(
        self, columns: Columns, z: NDArray, cells: NDArray, weights: NDArray,
        common: tuple[float, float] = NONE,
    ) -> None:  # fmt: skip
        """Weight the readings, and project out the pose of the measuring frame."""
        self.columns, self.cells, self.weights = columns, cells, weights
        self.given, self.common = z, common
        self.sampled = columns.sampled[cells]
        self.root = np.sqrt(weights)
        self.whiten = columns.whitening(cells, self.root, common)
        flat = self.whiten(columns.flat[cells])
        norm = np.maximum(np.linalg.norm(flat, axis=0), 1e-300)
        left, size, _ = np.linalg.svd(flat / norm, full_matrices=False)
        self.flat = left[:, size > _RANK * size.max(initial=0.0)]
        # The log determinant of the noise covariance includes the projection.

        seen = np.append(norm, size[: self.flat.shape[1]])
        self.log_det = self.whiten.log_det + 2 * float(np.log(seen).sum())
        self.z = self._without_flat(self.whiten(z))
        self.count = len(z) - self.flat.shape[1]
        self.small = self._without_flat(self.whiten(columns.nuisance.columns[cells]))
        self.gram = self.small.T @ self.small
        self._own: dict[Element, NDArray] = {}
        self._inner: dict[tuple[Element, Element | None], NDArray] = {}
        self._eigen: dict[Element, Eigen] = {}

    def _without_flat(self, columns: NDArray) -> NDArray:
        return columns - self.flat @ (self.flat.T @ columns)

    def sample(self, common: tuple[float, float]) -> "WeightedReadings":
        """Return the sampled readings, weighted for given common noise."""
        cells, some = self.cells.copy(), self.sampled
        cells[cells] = some
        return WeightedReadings(
            self.columns, self.given[some], cells, self.weights[some], common
        )

    def own(self, e: Element) -> NDArray:
        """Return the design matrix (n, m) of an effect or function for the fit."""
        if e in self._own:
            return self._own[e]
        B = self._without_flat(self.whiten(e.columns[self.cells]))
        if B.shape[1] <= NARROW:
            self._own[e] = B
        return B

    def products(self, elements: Sequence[Element]) -> tuple[NDArray, NDArray]:
        """Return inner products of the design matrices of effects and functions.

        The first array contains the products with the nuisance parameters.
        """
        for i, e in enumerate(elements):
            missing = [o for o in (None, *elements[: i + 1])
                       if (e, o) not in self._inner]  # fmt: skip
            B = self.own(e) if missing else self.small
            for o in missing:
                beside = self.small if o is None else B if o is e else self.own(o)
                self._inner[e, o] = beside.T @ B
                if o is not None:
                    self._inner[o, e] = self._inner[e, o].T
        empty = np.zeros((len(self.gram), 0))
        with_small = [empty, *(self._inner[e, None] for e in elements)]
        blocks = [[self._inner[e, o] for e in elements] for o in elements]
        return np.hstack(with_small), np.block(blocks or [[np.zeros((0, 0))]])

    def eigen(self, e: Element) -> Eigen:
        """Return the eigendecomposition of B'B for the design matrix B of an effect."""
        if e not in self._eigen:
            self._eigen[e] = np.linalg.eigh(self._inner[e, e])
        return self._eigen[e]

    def without_offsets(self, elements: Sequence[Element]) -> NDArray:
        """Return the readings (n,) minus the offsets of the effects."""
        z = self.z
        for e in elements:
            if e.offset is not None:
                z = z - self._without_flat(self.whiten(e.offset[self.cells]))
        return z

    def forget(self) -> None:
        """Release cached design matrices and inner products."""
        for one in (self._own, self._inner, self._eigen):
            one.clear()
