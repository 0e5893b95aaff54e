"""Many postures, many draws of errors, many designs: one question, a data set.

A sweep's points are its designs x postures x draws, draws innermost, cut into blocks
that are solved, journalled and written one after the other, in any order and by
anyone: no number depends on who solved it or what was solved before.
"""

import hashlib
import json
import signal
import threading
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from assembly.robot import Robot
from assembly.sweeps.dataset import sweep_dataset, write_sweep
from assembly.sweeps.identity import program_hash, question_hash, robot_hash
from assembly.sweeps.journal import open_journal
from assembly.sweeps.parameters import unit_of
from assembly.sweeps.points import Found, Points, solve_points
from assembly.sweeps.quantities import TEXTS, Question, record_type
from assembly.sweeps.targets import LARGEST_GRID, Targets, grid_targets, unit_of_target
from assembly.zone import ASSEMBLABLE
from stiffness.display import html_table, short_repr
from stiffness.reading import BadInput

if TYPE_CHECKING:
    import xarray

Progress = Callable[[int, int], None]
# yields each block's number with what was found there, in any order
Solver = Callable[["Sweep", Iterable[int]], Iterator[tuple[int, Found]]]


@dataclass(frozen=True, eq=False)
class Sweep:
    """A question and the points at which it is asked.

    Attributes:
        question: what is asked at each point.
        targets: the postures.
        values: of each number that varies, in the order of ``question.varied``.
        draws: number of draws of errors; 0 for the robot's own.
        command: that asked for it, for provenance; empty if none did.
        block_size: points solved and journalled together.
    """

    question: Question
    targets: Targets
    values: tuple[NDArray, ...] = ()
    draws: int = 0
    command: str = ""
    block_size: int = 128

    __repr__, _repr_html_ = short_repr, html_table

    def __post_init__(self) -> None:
        if self.size > LARGEST_GRID:
            raise BadInput(
                f"sweep: {self.size} points; expected at most {LARGEST_GRID}"
            )

    @property
    def dims(self) -> tuple[str, ...]:
        """Names of the axes of the points."""
        draw = ("draw",) if self.draws else ()
        return (*self.question.varied, *self.targets.dims, *draw)

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of points along each axis."""
        draw = (self.draws,) if self.draws else ()
        return (*(len(v) for v in self.values), *self.targets.shape, *draw)

    @property
    def size(self) -> int:
        """Number of points."""
        return int(np.prod(self.shape, dtype=float))

    @property
    def blocks(self) -> int:
        """Number of blocks."""
        return -(-self.size // self.block_size)

    def points(self, block: int) -> Points:
        """The points of a block."""
        first = block * self.block_size
        numbers = np.arange(first, min(first + self.block_size, self.size))
        numbers, draws = np.divmod(numbers, max(1, self.draws))
        count = int(np.prod(self.targets.shape))
        designs, postures = np.divmod(numbers, count)
        values = np.empty((len(numbers), len(self.values)))
        if self.values:
            shape = tuple(len(v) for v in self.values)
            for k, places in enumerate(np.unravel_index(designs, shape)):
                values[:, k] = self.values[k][places]
        return Points(values, self.targets.at(postures), draws)

    @property
    def units(self) -> dict[str, str]:
        """Unit of each number that varies and of each component of the postures."""
        robot = self.question.robot
        of_postures = {n: unit_of_target(n, robot) for n in self.targets.names}
        return {path: unit_of(path) for path in self.question.varied} | of_postures

    @cached_property
    def provenance(self) -> dict[str, str | int]:
        """Where the numbers come from, as attributes of the data set."""
        asked = self.question
        said: dict[str, str | int] = {
            "robot": asked.robot.name,
            "robot_sha256": robot_hash(asked.robot),
            "program": f"forcefit {version('forcefit')}",
            "program_sha256": program_hash(),
            "reading": asked.reading or "none",
            "near": repr(asked.near),
        }
        if asked.sources is not None:
            drawn = {k: v for k, v in vars(asked.sources).items() if k != "robot"}
            said |= {"seed": asked.seed, "errors_sha256": question_hash(drawn)}
        if self.command:
            said["command"] = self.command
        return said

    @property
    def identity(self) -> dict[str, str]:
        """What must be the same for two sweeps to share a journal."""
        asked = self.question
        said = {k: str(v) for k, v in self.provenance.items() if k != "command"}
        values = [*self.values, *self.targets.values]
        return said | {
            "points": " x ".join(
                f"{d} {n}" for d, n in zip(self.dims, self.shape, strict=True)
            ),
            "values_sha256": hashlib.sha256(
                b"".join(v.tobytes() for v in values)
                + json.dumps(self.targets.labels).encode()
            ).hexdigest(),
            "asked": " ".join(map(str, record_type(asked).names or ())),
            "wrenches": " ".join(asked.wrenches),
            "strength": str(asked.strength),
            "situation": str((asked.load, asked.gravity, dict(asked.under))),
            "block": str(self.block_size),
            # whatever is not named above
            "question_sha256": question_hash(asked),
        }


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
