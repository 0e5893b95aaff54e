"""How loops are compiled: once on each machine, by numba, which keeps them on disk.

They have one signature each, so that processes that compile at once write the same.
Assignments to slices, array expressions and sums bring numba's broadcasting along and
take several times as long to compile as loops (:mod:`assembly.solvers.vectors`).
Whoever waits for the first compilation is told so, once, on stderr.
"""

import multiprocessing
import sys
from functools import partial
from typing import Any

from numba import njit
from numba.core import event

kernel = partial(njit, cache=True, error_model="numpy", nogil=True)


class _Announcement(event.Listener):
    """One line when the first function of this package has to be compiled."""

    said = False

    def on_start(self, event: Any) -> None:
        function = event.data["dispatcher"].py_func
        ours = function.__module__.startswith("assembly.")
        first = multiprocessing.parent_process() is None and not self.said
        if ours and first:
            self.said = True
            print(
                "forcefit: compiling its solvers, once on this machine "
                "(`forcefit warm-up` does it beforehand)",
                file=sys.stderr,
            )

    def on_end(self, event: Any) -> None:
        """Nothing to say."""


event.register("numba:compile", _Announcement())
