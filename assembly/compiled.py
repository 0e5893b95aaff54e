"""How loops are compiled: once on each machine, by numba, which keeps them on disk.

``kernel`` is for functions that Python calls, ``part`` for those that only other
compiled ones call: without the wrappers for Python there is less to compile.  Whoever
waits for the first compilation is told so, once, on stderr.
"""

import multiprocessing
import sys
from functools import partial
from typing import Any

from numba import njit
from numba.core import event

kernel = partial(njit, cache=True, error_model="numpy", nogil=True)
part = partial(kernel, no_cpython_wrapper=True, no_cfunc_wrapper=True)


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
