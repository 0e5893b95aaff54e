"""Computation of a sweep over design parameters, postures and random errors.

The points of a sweep are all combinations of designs, postures and draws, in this
order; the draw varies fastest. They are divided into blocks, which are solved
independently and in any order.
"""

import signal
import threading
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from forcefit.assembly.linear.zone import ASSEMBLABLE
from forcefit.assembly.model.robot import Robot
from forcefit.assembly.sweeps.dataset import sweep_dataset, write_sweep
from forcefit.assembly.sweeps.journal import open_journal
from forcefit.assembly.sweeps.plan import Sweep
from forcefit.assembly.sweeps.points import SolvedPoints, solve_points
from forcefit.assembly.sweeps.quantities import TEXTS, Question, record_type
from forcefit.assembly.sweeps.targets import grid_targets

if TYPE_CHECKING:
    import xarray

Progress = Callable[[int, int], None]
# function that yields index and results of each block, in any order
Solver = Callable[["Sweep", Iterable[int]], Iterator[tuple[int, SolvedPoints]]]


def solve_here(
    sweep: Sweep, blocks: Iterable[int]
) -> Iterator[tuple[int, SolvedPoints]]:
    """Solve blocks sequentially on one thread."""
    # With several threads, small matrices are slower and round-off errors differ.
    with threadpool_limits(1), _interrupts_noted() as noted:
        for block in blocks:
            yield block, solve_points(sweep.question, sweep.points(block))
            if noted:
                raise KeyboardInterrupt


@contextmanager
def _interrupts_noted() -> Generator[list[int], None, None]:
    """Delay the first Ctrl-C until the current block is finished."""
    noted: list[int] = []
    if threading.current_thread() is not threading.main_thread():
        yield noted
        return
    before = signal.getsignal(signal.SIGINT)

    def note(number: int, _: object) -> None:
        noted.append(number)
        signal.signal(signal.SIGINT, before)

    signal.signal(signal.SIGINT, note)
    try:
        yield noted
    finally:
        signal.signal(signal.SIGINT, before)


def run_sweep(
    sweep: Sweep,
    path: Path | str,
    progress: Progress = lambda done, total: None,
    solve: Solver = solve_here,
    held: ExitStack | None = None,
) -> None:
    """Solve a sweep and write a NetCDF file.

    Finished blocks are stored in the journal ``<path>.journal``, from which an
    interrupted sweep resumes. The resulting file does not depend on interruptions.

    Args:
        sweep: sweep to solve.
        path: path of the NetCDF file.
        progress: function called after each block with the number of finished points
            and the number of all points.
        solve: function that solves blocks, such as :func:`solve_here`.
        held: exit stack that removes the journal when it is closed. By default, the
            journal is removed when the file is complete.

    Raises:
        BadInput: the journal belongs to another sweep or is used by another process, or
            a file cannot be written.
    """
    path = Path(path)
    kind = record_type(sweep.question)
    with ExitStack() as own:
        held = own if held is None else held
        journal = held.enter_context(
            open_journal(journal_path(path), sweep.identity, kind)
        )
        done = sum(_length(sweep, block) for block in journal.places)
        progress(done, sweep.size)
        waiting = [b for b in range(sweep.blocks) if b not in journal.places]
        for block, solved in solve(sweep, waiting):
            journal.add(block, solved.records, solved.texts)
            done += _length(sweep, block)
            progress(done, sweep.size)
        write_sweep(sweep, journal.read, path)
        journal.remove_after(held)


def journal_path(path: Path | str) -> Path:
    """Return the path of the journal for an output file."""
    path = Path(path)
    return path.with_name(path.name + ".journal")


def _length(sweep: Sweep, block: int) -> int:
    """Return the number of points of a block."""
    return min(sweep.block_size, sweep.size - block * sweep.block_size)


def sweep_in_memory(
    sweep: Sweep, progress: Progress = lambda done, total: None
) -> "xarray.Dataset":
    """Solve a sweep without a file.

    Args:
        sweep: sweep to solve.
        progress: see :func:`run_sweep`.

    Returns:
        The data set that :func:`run_sweep` would write.
    """
    records = np.zeros(sweep.size, record_type(sweep.question))
    texts: dict[str, dict[int, str]] = {name: {} for name in TEXTS}
    for block, solved in solve_here(sweep, range(sweep.blocks)):
        first = block * sweep.block_size
        records[first : first + len(solved.records)] = solved.records
        for name in TEXTS:
            texts[name] |= {first + i: t for i, t in solved.texts[name].items()}
        progress(first + len(solved.records), sweep.size)
    return sweep_dataset(sweep, records, texts)


def sweep_poses(
    robot: Robot,
    axes: Mapping[str, NDArray],
    progress: Progress = lambda done, total: None,
    assumption: str | None = None,
) -> "xarray.Dataset":
    """Compute margins, energy and pose error bounds on a grid of poses.

    Args:
        robot: robot with its errors, clearances and stiffnesses.
        axes: values [m or rad] by pose component or ``q.<frame>``. Other components are
            free.
        progress: see :func:`run_sweep`.
        assumption: assumption of problem (27): ``"frozen"``, ``"free"`` or
            ``"budget"``; None to omit pose error bounds.

    Returns:
        Data set with ``margin``, ``margin_free``, ``energy``, ``platform_screw``,
        ``status``, certificates and distances to singularities. With an assumption, it
        also contains ``rotation_error`` and ``translation_error`` (lower and upper
        bounds). Values are NaN at points without a solution.
    """
    targets = grid_targets(axes)
    question = Question(robot, components=targets.names, assumption=assumption)
    return sweep_in_memory(Sweep(question, targets), progress)


def assemblable(data: "xarray.Dataset", key: str = "margin_free") -> NDArray:
    """Return which points are inside the assembly zone, as a bool array."""
    return np.asarray(data[key] <= ASSEMBLABLE)
