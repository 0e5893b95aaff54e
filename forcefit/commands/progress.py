"""Progress bars, progress lines, and a limit on the number of threads."""

import logging
import sys
import time
from collections.abc import Generator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from threading import Timer
from typing import Any

from forcefit.inputs.errors import BadInput

_DELAY = 2.0  # [s] shortest time between two lines of progress


def one_thread() -> AbstractContextManager:
    """Limit linear algebra to one thread, because the matrices of a posture are small.

    With more threads, idle ones would spin and slow down the working thread.  Without
    the package ``threadpoolctl``, the number of threads is not limited.
    """
    try:
        from threadpoolctl import threadpool_limits
    except ModuleNotFoundError:
        return nullcontext()
    return threadpool_limits(1)


class _Links(logging.Handler):
    """Log handler that reports each solved link with a line or a progress bar."""

    def __init__(self) -> None:
        super().__init__()
        self.done, self.total = 0, 0
        self.bar: Any = None

    def emit(self, record: logging.LogRecord) -> None:
        """Advance the bar if the record counts links; otherwise print its message."""
        if not hasattr(record, "total"):
            self._begin()
            print(f"forcefit: {record.getMessage()}", file=sys.stderr)
            return
        self.done, self.total = vars(record)["done"], record.total
        if self.bar is not None:
            self.bar.update(self.bar.task_ids[0], completed=self.done)
            if self.done == self.total:
                self.bar.stop()
                self.bar = None

    def _begin(self) -> None:
        """Start a bar, if stderr is a terminal that does not show a bar yet."""
        from rich.console import Console
        from rich.errors import LiveError
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

        console = Console(stderr=True)
        if self.bar is not None or not console.is_terminal:
            return
        columns = TextColumn("links"), BarColumn(), MofNCompleteColumn()
        bar = Progress(*columns, console=console)
        bar.add_task("links", total=self.total, completed=self.done)
        try:
            bar.start()
        except LiveError:
            return
        self.bar = bar


def report_loading() -> None:
    """Report the progress of finite element solutions while a robot is being loaded."""
    log = logging.getLogger("forcefit.links")
    log.setLevel(logging.DEBUG)
    log.handlers = [_Links()]


@contextmanager
def progress_lines() -> Generator[Any, None, None]:
    """Print progress lines for a computation that is usually short; yield ``update``.

    ``update(what, done, most)`` prints at most one line every two seconds. No bar is
    shown, because the total number of steps is not known in advance.
    """
    last = time.monotonic()

    def update(what: str, done: int, most: int) -> None:
        nonlocal last
        if time.monotonic() - last >= _DELAY:
            last = time.monotonic()
            print(f"forcefit: {what}: {done} of at most {most}", file=sys.stderr)

    yield update


@contextmanager
def progress_bars() -> Generator[Any, None, None]:
    """Show progress bars on stderr; yield ``update(what, done, total)``.

    If stderr is not a terminal, the bars are printed only at the end, in addition to
    one line for each task that takes longer than two seconds.  On bad input, the bars
    are removed.
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
                    line_of_progress = f"{what}: {done} of {total}"
                    waiting.append(
                        Timer(_DELAY, print, [line_of_progress], {"file": sys.stderr})
                    )
                    waiting[-1].daemon = True
                    waiting[-1].start()
                # points from an earlier run must not count towards the rate of this run
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
            bars.disable = True  # otherwise closing the bar prints an empty line
            raise
        finally:
            for line in waiting:
                line.cancel()
