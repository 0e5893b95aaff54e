"""Monte Carlo simulation of random errors at one posture.

Problems (21), (22) and (27) are solved for each draw. A draw depends only on its index
and the seed, so the result does not depend on the number of threads. If an output file
is given, finished blocks of draws are stored in a journal next to this file. An
interrupted run resumes from the journal.
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

from forcefit.assembly.kinematics.posture import POSE
from forcefit.assembly.statistics.clearance_positions import clearance_means
from forcefit.assembly.statistics.experiment import Experiment
from forcefit.assembly.statistics.importance_table import (
    ImportanceOptions,
    importance_dataset,
    importance_design,
    importance_rows,
)
from forcefit.assembly.statistics.perfect_parts import stored_perfect_parts
from forcefit.assembly.statistics.quantities import POSE_ERRORS
from forcefit.assembly.sweeps.dataset import save_dataset
from forcefit.assembly.sweeps.identity import program_hash, robot_hash
from forcefit.assembly.sweeps.journal import open_journal
from forcefit.assembly.sweeps.sweep import journal_path
from forcefit.inputs.packages import need
from forcefit.results.quantities import QUANTITIES, count
from forcefit.stiffness.screws import SCREW, WRENCH

if TYPE_CHECKING:
    import xarray

BLOCK = 1024  # number of draws in a block of the journal
_QUEUED = 4  # largest number of queued blocks per thread


def run_draws(
    experiment: Experiment,
    count: int,
    path: Path | str | None = None,
    workers: int = 1,
    progress: Callable[[int, int], None] = lambda done, total: None,
    importance: ImportanceOptions | int | None = None,
    held: ExitStack | None = None,
) -> "xarray.Dataset":
    """Solve draws 0 to count - 1 of an experiment.

    Args:
        experiment: error distributions and quantities.
        count: number of draws.
        path: NetCDF file to write; a journal next to it exists during the computation.
        workers: number of threads.
        progress: function called with the number of finished draws and the number of
            all draws.
        importance: options for the importance of errors, or its number of base draws;
            None to omit the importance.
        held: exit stack that removes the journal when it is closed, as in
            :func:`forcefit.assembly.sweeps.sweep.run_sweep`.

    Returns:
        Data set with the dimension ``draw``, which is also written to ``path``.

    Raises:
        BadInput: the journal belongs to other draws or is used by another process, or a
            file cannot be written.
        ModuleNotFoundError: xarray is missing.
    """
    need("xarray")
    if isinstance(importance, int):
        importance = ImportanceOptions(importance)
    with ExitStack() as own:
        return _run_draws(
            experiment, count, path, workers, progress, importance, held or own
        )


def _run_draws(
    experiment: Experiment, count: int, path: Path | str | None, workers: int,
    progress: Callable[[int, int], None], importance: ImportanceOptions | None,
    held: ExitStack,
) -> "xarray.Dataset":  # fmt: skip
    """Return the data set of draws; ``held`` removes the journal when closed."""
    design = None if importance is None else importance_design(experiment, importance)
    more = 0 if design is None else len(design)
    # First row and number of rows of each block: blocks of draws, then of the design.
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
        # The confidence level is omitted because it does not change the draws.
        rows_of_design = importance and (importance.draws, importance.by)
        identity = provenance(experiment) | {
            "draws": count, "block": BLOCK, "importance": str(rows_of_design),
        }  # fmt: skip
        journal = held.enter_context(
            open_journal(journal_path(path), identity, experiment.record_type)
        )
        kept = {b: journal.read(b)[0] for b in journal.places}
    done = sum(map(len, kept.values()))
    progress(done, count + more)
    missing = [b for b in range(len(spans)) if b not in kept]
    with threadpool_limits(1):  # one thread per block in linear algebra libraries
        for block, rows in _solved(solve, missing, workers):
            if journal is not None:
                journal.add(block, rows, {})
            kept[block] = rows
            done += len(rows)
            progress(done, count + more)
    data = draws_dataset(experiment, np.concatenate([kept[b] for b in range(drawn)]))
    if design is not None:
        rows = np.concatenate([kept[b] for b in range(drawn, len(spans))])
        assert importance is not None
        indices = importance_dataset(experiment, design, rows, importance.level)
        data = data.merge(indices, combine_attrs="no_conflicts")
    if path is not None and journal is not None:
        save_dataset(data, path)
        journal.remove_after(held)
    return data


def _solved(
    solve: Callable[[int], NDArray], blocks: list[int], workers: int
) -> Iterator[tuple[int, NDArray]]:
    """Yield the indices and results of blocks as soon as they are solved."""
    if not blocks:
        return
    # Solve the first block alone to fill caches that all threads use.
    yield blocks[0], solve(blocks[0])
    waiting = iter(blocks[1:])
    with ThreadPoolExecutor(workers) as pool:
        begun: set[Future] = set()
        try:
            while True:
                for block in waiting:
                    begun.add(pool.submit(lambda b: (b, solve(b)), block))
                    if len(begun) >= _QUEUED * workers:
                        break
                if not begun:
                    return
                finished, begun = wait(begun, return_when=FIRST_COMPLETED)
                for future in finished:
                    yield future.result()
        finally:
            for future in begun:
                future.cancel()


def provenance(experiment: Experiment) -> dict[str, str | int | float]:
    """Return values that identify the draws of an experiment."""
    posture, sources = experiment.posture, experiment.sources
    contact = experiment.used_contact_length
    numbers = [*sources.identity, posture.transforms]
    digest = sha256(b"".join(np.ascontiguousarray(n).tobytes() for n in numbers))
    return {
        "robot": posture.robot.name,
        "robot_sha256": robot_hash(posture.robot),
        "sources_and_posture_sha256": digest.hexdigest(),
        "seed": experiment.seed,
        "clearance": experiment.clearance,
        **({} if contact is None else {"contact_length": contact}),
        "precision": " ".join(map(repr, experiment.precision)),
        "margins": int(experiment.margins),
        "stress": int(experiment.stress),
        "load": " ".join(map(repr, experiment.wrench or ())),
        "gravity": " ".join(map(repr, experiment.gravity or ())),
        "program": f"forcefit {version('forcefit')}",
        "program_sha256": program_hash(),
        **({"stiffness": experiment.stiffness} if experiment.stiffness else {}),
    }


def draws_dataset(experiment: Experiment, rows: NDArray) -> "xarray.Dataset":
    """Convert draws to a data set with units and provenance.

    Args:
        experiment: experiment of the draws.
        rows: (k,) records of the experiment's record type.

    Returns:
        Data set with the dimension ``draw``.
    """
    import xarray

    dims = {"platform_screw": ("draw", "screw"), "stress": ("draw", "link"),
            "stiffness": ("draw", "wrench_component"),
            "free_motion": ("draw", "motion", "screw")}  # fmt: skip
    known = {
        **QUANTITIES,
        "stiffness": QUANTITIES["axis_stiffness"],
        "status": count("status", meaning="0 solved, 1 no answer"),
    }
    attributes = {name: known[name].attributes for name in rows.dtype.names or ()}
    means = clearance_means(experiment.clearance, experiment.used_contact_length)
    worst = experiment.clearance == "worst"
    for name in POSE_ERRORS:
        bound = "upper bound of the " if worst else ""
        attributes[name]["long_name"] = f"{bound}{known[name].meaning}; {means}"
    if worst:
        attributes["platform_screw"]["long_name"] += f"; {clearance_means('least')}"
    variables = {
        name: (dims.get(name, ("draw",)), rows[name], attributes[name])
        for name in rows.dtype.names or ()
    }
    labels = {
        "draw": np.arange(len(rows)), "screw": list(SCREW),
        "link": list(experiment.links), "source": list(experiment.sources.labels),
    }  # fmt: skip
    if experiment.stiffness:
        labels |= {"wrench_component": list(WRENCH), "motion": np.arange(6)}
    pose = experiment.posture.pose()
    at = {f"pose.{k}": pose[k] for k in POSE if k in pose}
    alone = {"perfect_parts": stored_perfect_parts(experiment)}
    data = xarray.Dataset(variables, labels, provenance(experiment) | at | alone)
    if experiment.links:
        errors = np.array(experiment.stress_errors)
        data["stress"].attrs["estimated_relative_error"] = errors
    return data
