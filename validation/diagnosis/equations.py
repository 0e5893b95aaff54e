r"""The equations of small unknowns of any sizes, one block of them diagonal.

With S the sizes, M = I + S G S falls into a diagonal block D of unknowns set apart and
the rest R, between them a block E; all that is asked of M follows from its Schur
complement, which is as small as the rest:

    [ R  E ]
    [ E' D ],    L L' = R - E D^-1 E',    det M = det(L)^2 det D.

======  ===============  =========  ==================================================
symbol  code             shape      meaning
======  ===============  =========  ==================================================
G       ``gram``         (k, k)     inner products of columns
S       ``size``         (k,)       standard deviations of the unknowns
b       ``along``        (k,)       products of columns and readings
W       ``across``       (r, k-r)   E D^-1/2
======  ===============  =========  ==================================================
"""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.blas import dtrmm
from scipy.linalg.lapack import dpotrf, dpotrs, dtrtri


class Equations:
    """M = I + S G S for any sizes S."""

    def __init__(self, gram: NDArray, along: NDArray, apart: NDArray) -> None:
        """Sort unknowns.

        Args:
            gram: (k, k).
            along: (k,).
            apart: (k,) bool, unknowns whose own part of ``gram`` is diagonal.
        """
        self._apart, self._rest = np.flatnonzero(apart), np.flatnonzero(~apart)
        self._along = along
        self._squares = np.diag(gram)[self._apart]
        self._inner, self._across = gram, np.zeros((len(gram), 0))
        if len(self._apart):
            self._inner = gram[np.ix_(self._rest, self._rest)]
            self._across = gram[np.ix_(self._rest, self._apart)]

    def solved(self, size: NDArray) -> tuple[NDArray, float, NDArray]:
        """Solve them.

        Args:
            size: (k,) of all unknowns.

        Returns:
            M^-1 S b (k,), ln det M / 2, and the diagonal of M^-1 (k,).

        Raises:
            LinAlgError: M is not positive definite by rounding.
        """
        x, inverse = np.zeros((2, len(size)))
        own, s = size[self._apart], size[self._rest]
        scaled = size * self._along
        root = np.sqrt(1.0 + own**2 * self._squares)
        M = self._inner * np.outer(s, s)
        M[np.diag_indices(len(M))] += 1.0
        wanted, held = scaled[self._rest], scaled[self._apart] / root
        if len(own):
            W = self._across * np.outer(s, own / root)
            M -= W @ W.T
            wanted = wanted - W @ held
        if not len(s):
            x[self._apart], inverse[self._apart] = held / root, 1 / root**2
            return x, float(np.log(root).sum()), inverse
        # M is symmetric, so that its transpose is in the order that the routines take
        factor, failed = dpotrf(M.T, lower=True, overwrite_a=True)
        if failed:
            raise np.linalg.LinAlgError("sizes beyond what rounding allows")
        log = float(np.log(np.diag(factor)).sum() + np.log(root).sum())
        x[self._rest] = dpotrs(factor, wanted, lower=True)[0]
        # M^-1 = L^-T L^-1: its diagonal takes half of the work of the whole of it
        turned, _ = dtrtri(factor, lower=True, overwrite_c=True)
        inverse[self._rest] = np.einsum("ij,ij->j", turned, turned)
        if len(own):
            x[self._apart] = (held - W.T @ x[self._rest]) / root
            through = dtrmm(1.0, turned, W.T, side=1, lower=1, trans_a=1, overwrite_b=1)
            grown = 1.0 + np.einsum("ij,ij->i", through, through)
            inverse[self._apart] = grown / root**2
        return x, log, inverse
