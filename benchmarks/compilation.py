"""Processor time that compiling takes, function by function, on an empty cache.

    python benchmarks/compilation.py [ROWS]

Prints the sum over everything ``forcefit warm-up`` compiles and the ROWS (20) longest,
what they call not counted in.
"""

import os
import sys
import tempfile
import time
from collections import Counter
from typing import Any

with tempfile.TemporaryDirectory() as cache:
    os.environ["NUMBA_CACHE_DIR"] = cache  # before numba is imported
    from numba.core import event

    from forcefit.commands.warm_up import warm_up

    seconds: Counter[str] = Counter()

    class Clock(event.Listener):
        """A stack of compilations, each with what those within it took."""

        def __init__(self) -> None:
            self.running: list[list[float]] = []

        def on_start(self, event: Any) -> None:
            """One begins."""
            self.running.append([time.process_time(), 0.0])

        def on_end(self, event: Any) -> None:
            """One ends; its time is not its caller's."""
            began, within = self.running.pop()
            whole = time.process_time() - began
            function = event.data["dispatcher"].py_func
            seconds[f"{function.__module__}.{function.__name__}"] += whole - within
            if self.running:
                self.running[-1][1] += whole

    event.register("numba:compile", Clock())
    began = time.process_time()
    warm_up()
    print(f"{sum(seconds.values()):7.2f} s compiling {len(seconds)} functions")
    print(f"{time.process_time() - began:7.2f} s in all, from imported to answered")
    rows = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    for name, taken in seconds.most_common(rows):
        print(f"{taken:7.2f} s {name}")
