"""Many postures, many draws of errors, many designs: one question, a data set.

A sweep's points are its designs x postures x draws, draws innermost, cut into blocks
that are solved, journalled and written one after the other, in any order and by
anyone: no number depends on who solved it or what was solved before.
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

from assembly.linear.zone import ASSEMBLABLE
from assembly.model.robot import Robot
from assembly.sweeps.dataset import sweep_dataset, write_sweep
from assembly.sweeps.journal import open_journal
from assembly.sweeps.plan import Sweep
from assembly.sweeps.points import Found, solve_points
from assembly.sweeps.quantities import TEXTS, Question, record_type
from assembly.sweeps.targets import grid_targets

if TYPE_CHECKING:
    import xarray

Progress = Callable[[int, int], None]
# yields each block's number with what was found there, in any order
Solver = Callable[["Sweep", Iterable[int]], Iterator[tuple[int, Found]]]


def solve_here(sweep: Sweep, blocks: Iterable[int]) -> Iterator[tuple[int, Found]]:
    """Solve blocks one after the other, on one thread."""
    # small matrices: more threads take longer, and sum in another order
    with threadpool_limits(1), _interrupts_noted() as noted:
        for block in blocks:
            yield block, solve_points(sweep.question, sweep.points(block))
            if noted:
                raise KeyboardInterrupt


@contextmanager
def _interrupts_noted() -> Generator[list[int], None, None]:
    """Ctrl-C is noted, so that a block is finished; a second one stops at once."""
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
    """Solve a sweep into a NetCDF file, going on from its journal if there is one.

    The journal, ``<path>.journal``, holds every finished block from the first on; kill
    the program when you like, the same sweep goes on from there and ends in the same
    file, byte for byte.

    Args:
        sweep: what to solve.
        path: of the file; it appears when it is complete, and the journal goes.
        progress: called at the start and after each block with the number of points
            that are in the journal, and of all.
        solve: solves blocks: :func:`solve_here`, or :mod:`assembly.sweeps.cluster`.
        held: keeps the journal until it is closed, for what is still made of the
            file: killed meanwhile, the same sweep has nothing to solve again.

    Raises:
        BadInput: the journal is another sweep's, another run holds it, or a file
            cannot be written.
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
        for block, found in solve(sweep, waiting):
            journal.add(block, found.records, found.texts)
            done += _length(sweep, block)
            progress(done, sweep.size)
        write_sweep(sweep, journal.read, path)
        journal.remove_after(held)


def journal_path(path: Path | str) -> Path:
    """Where the journal of a file stands."""
    path = Path(path)
    return path.with_name(path.name + ".journal")


def _length(sweep: Sweep, block: int) -> int:
    """Number of points of a block."""
    return min(sweep.block_size, sweep.size - block * sweep.block_size)


def sweep_in_memory(
    sweep: Sweep, progress: Progress = lambda done, total: None
) -> "xarray.Dataset":
    """Solve a sweep without a file.

    Args:
        sweep: what to solve.
        progress: called after each block with the number of points done, and of all.

    Returns:
        The data set that :func:`run_sweep` would write.
    """
    records = np.zeros(sweep.size, record_type(sweep.question))
    texts: dict[str, dict[int, str]] = {name: {} for name in TEXTS}
    for block, found in solve_here(sweep, range(sweep.blocks)):
        first = block * sweep.block_size
        records[first : first + len(found.records)] = found.records
        for name in TEXTS:
            texts[name] |= {first + i: t for i, t in found.texts[name].items()}
        progress(first + len(found.records), sweep.size)
    return sweep_dataset(sweep, records, texts)


def sweep_poses(
    robot: Robot,
    axes: Mapping[str, NDArray],
    progress: Progress = lambda done, total: None,
    reading: str | None = None,
) -> "xarray.Dataset":
    """Solve (21) and (22), and if asked (27), at every pose of a grid.

    Args:
        robot: with its errors, clearances and stiffnesses.
        axes: values [m or rad] by pose component or ``q.<frame>``; components not named
            are free.
        progress: called after each block with the number of points done, and of all.
        reading: of problem (27): ``"frozen"``, ``"free"`` or ``"budget"``; None leaves
            the bounds of the pose error out.

    Returns:
        Data set over the axes: ``margin``, ``margin_free``, ``energy``,
        ``platform_screw``, with a reading ``rotation_error`` and ``translation_error``
        (lower and upper), certificates, distances to singularities and ``status``; NaN
        where there is no answer, and the status then says why.
    """
    targets = grid_targets(axes)
    question = Question(robot, components=targets.names, reading=reading)
    return sweep_in_memory(Sweep(question, targets), progress)


def assemblable(data: "xarray.Dataset", key: str = "margin_free") -> NDArray:
    """Bool over the grid: where the margin says it goes together rigidly."""
    return np.asarray(data[key] <= ASSEMBLABLE)
