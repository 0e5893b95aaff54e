"""Progress bars, and how many threads work."""

import sys
import time
from collections.abc import Generator
from contextlib import AbstractContextManager, contextmanager
from threading import Timer
from typing import Any

from forcefit.inputs.errors import BadInput

_MOMENT = 2.0  # [s] that may pass without a word


def one_thread() -> AbstractContextManager:
    """Linear algebra on one thread: a posture's matrices are too small for more.

    The others would spin while they wait for work, at the cost of this one's time.
    """
    from threadpoolctl import threadpool_limits

    return threadpool_limits(1)


@contextmanager
def progress_bars() -> Generator[Any, None, None]:
    """Progress bars on stderr; yields ``update(what, done, total)``, a bar for each.

    Where stderr is no terminal, bars show at the end alone: a line says what takes
    longer than a moment.  Bad input leaves none, its message is enough.
    """
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(),
        TextColumn("{task.fields[rate]}"), TimeElapsedColumn(), TimeRemainingColumn(),
    )  # fmt: skip
    tasks: dict[str, Any] = {}
    began: dict[str, tuple[float, int]] = {}
    waiting: list[Timer] = []
    console = Console(stderr=True)
    with Progress(*columns, console=console) as bars:

        def update(what: str, done: int, total: int) -> None:
            if what not in tasks:
                if not console.is_terminal:
                    said = f"{what}: {done} of {total}"
                    waiting.append(Timer(_MOMENT, print, [said], {"file": sys.stderr}))
                    waiting[-1].daemon = True
                    waiting[-1].start()
                # what was done in an earlier run does not count in the rate
                tasks[what] = bars.add_task(what, total=total, completed=done, rate="")
                began[what] = time.monotonic(), done
            start, before = began[what]
            passed = time.monotonic() - start
            rate = f"{(done - before) / passed:.3g}/s" if done > before else ""
            bars.update(tasks[what], completed=done, total=total, rate=rate)

        try:
            yield update
        except BadInput:
            bars.live.transient = True
            bars.live.stop()
            bars.disable = True  # or it ends with an empty line
            raise
        finally:
            for line in waiting:
                line.cancel()
