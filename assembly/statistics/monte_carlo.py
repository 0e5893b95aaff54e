"""Monte Carlo at one posture: errors drawn, problems (21), (22) and (27) for each.

A block of draws is solved at a time, in any order and by any number of threads; each
draw depends on its own number and the seed alone.  With a file, finished blocks go to a
journal beside it from the first on: a run that was killed goes on where it stopped.
The rows of a design that tells the importance of errors are blocks like any others.
"""

from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import ExitStack
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from assembly.kinematics.posture import POSE
from assembly.statistics.experiment import Experiment
from assembly.statistics.importance_table import (
    importance_dataset,
    importance_design,
    importance_rows,
)
from assembly.statistics.play import PLAY
from assembly.statistics.quantities import MEANINGS, POSE_ERRORS, UNITS
from assembly.sweeps.dataset import save_dataset
from assembly.sweeps.identity import program_hash, robot_hash
from assembly.sweeps.journal import open_journal
from assembly.sweeps.sweep import journal_path
from stiffness.screws import SCREW

if TYPE_CHECKING:
    import xarray

BLOCK = 1024  # draws solved and journalled together
_WAITING = 4  # blocks begun ahead of each thread


def run_draws(
    experiment: Experiment,
    count: int,
    path: Path | str | None = None,
    workers: int = 1,
    progress: Callable[[int, int], None] = lambda done, total: None,
    importance: tuple[int, str] | None = None,
    level: float = 0.95,
    held: ExitStack | None = None,
) -> "xarray.Dataset":
    """Solve draws 0 .. count - 1.

    Args:
        experiment: what is drawn and asked.
        count: how many draws.
        path: NetCDF file to write; its journal is used and then removed.
        workers: threads.
        progress: called with the draws done and their number.
        importance: base draws for the importance of errors, and what to group them by,
            see :func:`assembly.statistics.importance.source_groups`; not asked if None.
        level: of confidence of the importance's intervals.
        held: keeps the journal until it is closed, as in
            :func:`assembly.sweeps.sweep.run_sweep`.

    Returns:
        Data set over ``draw``, with the importance if asked; the file holds the same.

    Raises:
        BadInput: the journal is another run's or held by one, or a file cannot be
            written.
    """
    with ExitStack() as own:
        return _run_draws(
            experiment, count, path, workers, progress, importance, level, held or own
        )


def _run_draws(
    experiment: Experiment, count: int, path: Path | str | None, workers: int,
    progress: Callable[[int, int], None], importance: tuple[int, str] | None,
    level: float, held: ExitStack,
) -> "xarray.Dataset":  # fmt: skip
    """The same; ``held`` keeps the journal."""
    design = None if importance is None else importance_design(experiment, *importance)
    more = 0 if design is None else len(design)
    # blocks of draws, then of the design: first row and number of rows of each
    spans = [(i, min(BLOCK, count - i)) for i in range(0, count, BLOCK)]
    drawn = len(spans)
    spans += [(i, min(BLOCK, more - i)) for i in range(0, more, BLOCK)]

    def solve(block: int) -> NDArray:
        if block < drawn:
            return experiment.solve(*spans[block])
        assert design is not None
        return importance_rows(experiment, design, *spans[block])

    kept: dict[int, NDArray] = {}
    journal = None
    if path is not None:
        identity = provenance(experiment) | {
            "draws": count, "block": BLOCK, "importance": str(importance),
        }  # fmt: skip
        journal = held.enter_context(
            open_journal(journal_path(path), identity, experiment.record_type)
        )
        kept = {b: journal.read(b)[0] for b in journal.places}
    done = sum(map(len, kept.values()))
    progress(done, count + more)
    missing = [b for b in range(len(spans)) if b not in kept]
    with threadpool_limits(1):  # the threads are ours
        for block, rows in _solved(solve, missing, workers):
            if journal is not None:
                journal.add(block, rows, {})
            kept[block] = rows
            done += len(rows)
            progress(done, count + more)
    data = draws_dataset(experiment, np.concatenate([kept[b] for b in range(drawn)]))
    if design is not None:
        rows = np.concatenate([kept[b] for b in range(drawn, len(spans))])
        shares = importance_dataset(experiment, design, rows, level)
        data = data.merge(shares, combine_attrs="no_conflicts")
    if path is not None and journal is not None:
        save_dataset(data, path)
        journal.remove_after(held)
    return data


def _solved(
    solve: Callable[[int], NDArray], blocks: list[int], workers: int
) -> Iterator[tuple[int, NDArray]]:
    """Blocks as they are finished; a few are begun ahead, so memory stays bounded."""
    if not blocks:
        return
    # made ready once, before the threads ask for it
    yield blocks[0], solve(blocks[0])
    waiting = iter(blocks[1:])
    with ThreadPoolExecutor(workers) as pool:
        begun: set[Future] = set()
        try:
            while True:
                for block in waiting:
                    begun.add(pool.submit(lambda b: (b, solve(b)), block))
                    if len(begun) >= _WAITING * workers:
                        break
                if not begun:
                    return
                finished, begun = wait(begun, return_when=FIRST_COMPLETED)
                for future in finished:
                    yield future.result()
        finally:
            for future in begun:
                future.cancel()


def provenance(experiment: Experiment) -> dict[str, str | int]:
    """What must be the same for two runs to give the same draws."""
    posture, sources = experiment.posture, experiment.sources
    numbers = [
        sources.frame, sources.component, sources.kind, sources.centre, sources.scale,
        sources.least, sources.limit, sources.signed, posture.transforms,
    ]  # fmt: skip
    digest = sha256(b"".join(np.ascontiguousarray(n).tobytes() for n in numbers))
    return {
        "robot": posture.robot.name,
        "robot_sha256": robot_hash(posture.robot),
        "sources_and_posture_sha256": digest.hexdigest(),
        "seed": experiment.seed,
        "play": experiment.play,
        "precision": " ".join(map(repr, experiment.precision)),
        "margins": int(experiment.margins),
        "stress": int(experiment.stress),
        "load": " ".join(map(repr, experiment.load or ())),
        "gravity": " ".join(map(repr, experiment.gravity or ())),
        "program": f"forcefit {version('forcefit')}",
        "program_sha256": program_hash(),
    }


def draws_dataset(experiment: Experiment, rows: NDArray) -> "xarray.Dataset":
    """The draws as a data set with units and where they came from.

    Args:
        experiment: whose draws.
        rows: (k,) of its record type.

    Returns:
        Data set over ``draw``; the pose errors say what is assumed of play.
    """
    import xarray

    dims = {"platform_screw": ("draw", "screw"), "stress": ("draw", "link")}
    said = MEANINGS | {
        k: f"{MEANINGS[k]}; {PLAY[experiment.play]}" for k in POSE_ERRORS
    }
    if experiment.play == "worst":
        said |= {k: f"upper bound of the {said[k]}" for k in POSE_ERRORS}
        said["platform_screw"] += f"; {PLAY['least']}"
    variables = {
        name: (
            dims.get(name, ("draw",)), rows[name],
            {"units": UNITS.get(name, "1"), "long_name": said[name]},
        )
        for name in rows.dtype.names or ()
    }  # fmt: skip
    labels = {
        "draw": np.arange(len(rows)), "screw": list(SCREW),
        "link": list(experiment.links), "source": list(experiment.sources.labels),
    }  # fmt: skip
    pose = experiment.posture.pose()
    at = {f"pose.{k}": pose[k] for k in POSE if k in pose}
    return xarray.Dataset(variables, labels, provenance(experiment) | at)
