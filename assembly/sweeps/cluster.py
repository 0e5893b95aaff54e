"""Parallel computation of a sweep with Dask, on this machine or on a cluster.

To limit memory use, the client submits only a few tasks per worker at a time. A task
consists of the blocks of points that can be solved in about half a second. The last
tasks are smaller, so that all workers finish at nearly the same time. The results do
not depend on the number of workers.
"""

import logging
import pickle
import signal
import threading
import time
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager
from dataclasses import replace
from functools import lru_cache
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

from forcefit.assembly.files.solved_links import solve_links
from forcefit.assembly.sweeps.identity import program_hash, question_hash
from forcefit.assembly.sweeps.plan import Sweep
from forcefit.assembly.sweeps.points import Points, SolvedPoints, solve_points
from forcefit.assembly.sweeps.quantities import Question
from forcefit.assembly.sweeps.sweep import Solver
from forcefit.inputs.table import BadInput

if TYPE_CHECKING:
    import distributed

_TASK = 0.5  # [s] target duration of a task
_IN_FLIGHT = 3  # number of simultaneously submitted tasks per thread
_LARGEST = 256  # largest number of blocks per task
_LAST = 2  # minimum number of tasks per thread into which the last blocks are divided
# The profiler of Dask makes workers about 3 % slower.
_QUIET = {"distributed.worker.profile.enabled": False}
_PATIENCE = 60.0  # [s] time limit for the connection of the first worker

Task = tuple[int, Points]


def cluster_solver(
    workers: int | None = None,
    scheduler: str | None = None,
    report: Callable[[str], None] = lambda text: None,
) -> Solver:
    """Return a function that solves blocks of a sweep on a cluster.

    Args:
        workers: number of processes of a local cluster to start; None if
            ``scheduler`` is given.
        scheduler: address of the scheduler of a running cluster, such as
            ``tcp://10.0.0.1:8786``.
        report: function called at the end with a line of text on the number and the
            duration of tasks.

    Returns:
        The argument ``solve`` of :func:`.sweep.run_sweep`.
    """

    def solve(
        sweep: Sweep, blocks: Iterable[int]
    ) -> Iterator[tuple[int, SolvedPoints]]:
        import dask
        from distributed import Client, LocalCluster

        # Suppress log messages, because failures are reported by exceptions.
        logging.getLogger("distributed.client").setLevel(logging.CRITICAL)
        if scheduler is not None:
            with _connected(scheduler) as client:
                yield from _distribute_connected(client, sweep, [*blocks], report)
            return
        with _without_interrupts(), dask.config.set(_QUIET):
            local = LocalCluster(
                n_workers=workers, threads_per_worker=1, processes=True,
                dashboard_address=None, silence_logs=50,
            )  # fmt: skip
        with local as cluster, Client(cluster) as client:
            yield from _distribute_connected(client, sweep, [*blocks], report)

    return solve


@contextmanager
def _without_interrupts() -> Generator[None, None, None]:
    """Ignore Ctrl-C in processes that are started in this context."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _connected(address: str) -> "distributed.Client":
    """Return a client of a running scheduler."""
    from distributed import Client

    try:
        return Client(address, timeout=10)
    except (OSError, ValueError, TimeoutError) as error:
        reason = str(error).partition("\n")[0][:200] or "no answer"
        raise BadInput(
            f"--scheduler {address[:80]}: cannot be reached: {reason}"
        ) from None


def _distribute_connected(
    client: "distributed.Client",
    sweep: Sweep,
    blocks: list[int],
    report: Callable[[str], None],
) -> Iterator[tuple[int, SolvedPoints]]:
    """Distribute blocks, and raise an error if the scheduler is lost."""
    from distributed.comm import CommClosedError

    try:
        yield from _distribute(client, sweep, blocks, report)
    except (CommClosedError, CancelledError):
        raise BadInput(
            "sweep: the connection to the scheduler was lost; the journal contains "
            "the finished points; run the same command again to continue"
        ) from None


def _distribute(
    client: "distributed.Client",
    sweep: Sweep,
    blocks: list[int],
    report: Callable[[str], None],
) -> Iterator[tuple[int, SolvedPoints]]:
    """Submit blocks to workers, and yield results in any order."""
    from distributed import KilledWorker, as_completed

    _check_workers(client)
    question = pickle.dumps(sweep.question), question_hash(sweep.question)
    size, first, flying, times = 1, 0, 0, []
    waiting: Any = as_completed()

    def submit() -> None:
        nonlocal first, flying
        threads = _threads(client)
        while flying < _IN_FLIGHT * threads and first < len(blocks):
            share = -(-(len(blocks) - first) // (_LAST * threads))
            last = first + min(size, share)
            tasks = [(block, sweep.points(block)) for block in blocks[first:last]]
            first = last
            waiting.add(client.submit(solve_task, *question, tasks, pure=False))
            flying += 1

    submit()
    for future in waiting:
        try:
            seconds, solved = future.result()
        except KilledWorker:
            raise BadInput(
                "sweep: all workers that computed some of the points were "
                "terminated, for example because of insufficient memory; the "
                "journal contains all other points"
            ) from None
        future.release()
        flying -= 1
        times.append(seconds)
        per_block = seconds / len(solved)
        size = int(min(_LARGEST, max(1.0, _TASK / max(per_block, 1e-6))))
        yield from solved
        submit()
    if times:
        median = sorted(times)[len(times) // 2]
        report(f"{len(times)} tasks, {median:.2g} s each")


def _threads(client: "distributed.Client") -> int:
    """Return the present number of threads of all workers."""
    from distributed.comm import CommClosedError

    try:
        return max(1, sum(client.nthreads().values()))
    except OSError as error:  # no answer from the scheduler
        raise CommClosedError(str(error)) from error


def _check_workers(client: "distributed.Client") -> None:
    """Raise an error if there is no worker or if the program versions differ."""
    try:
        client.wait_for_workers(1, timeout=_PATIENCE)
    except TimeoutError:
        raise BadInput(
            f"sweep: no worker joined the scheduler in {_PATIENCE:.0f} s"
        ) from None
    ours = _program()
    for worker, theirs in client.run(_program).items():
        if theirs["program_sha256"] != ours["program_sha256"]:
            found, expected = (
                f"{one['program']}, program_sha256 {one['program_sha256'][:12]}"
                for one in (theirs, ours)
            )
            raise BadInput(f"sweep: worker {worker} has {found}, expected {expected}")


def _program() -> dict[str, str]:
    """Return the version of the program and a digest of its sources."""
    return {
        "program": f"forcefit {version('forcefit')}",
        "program_sha256": program_hash(),
    }


def solve_task(
    question: bytes, digest: str, tasks: list[Task]
) -> tuple[float, list[tuple[int, SolvedPoints]]]:
    """Solve blocks of points on one thread of a worker.

    Args:
        question: pickled :class:`Question` of the sweep.
        digest: digest of this :class:`Question` on the client.
        tasks: index and points of each block.

    Returns:
        Computation time [s], and index and results of each block.

    Raises:
        BadInput: the digest differs on this worker, for example because a mesh differs.
    """
    from threadpoolctl import threadpool_limits

    asked = _question(question, digest)
    start = time.perf_counter()
    with threadpool_limits(1):
        solved = [(block, solve_points(asked, points)) for block, points in tasks]
    return time.perf_counter() - start, solved


@lru_cache(maxsize=4)
def _question(content: bytes, digest: str) -> Question:
    """Return the :class:`Question` of a sweep, cached for all tasks of a worker."""
    asked: Question = pickle.loads(content)
    question = replace(asked, robot=solve_links(asked.robot))
    if question_hash(question) != digest:
        raise BadInput(
            "sweep: found different meshes or stiffness libraries on a worker; "
            "expected the same files at the same paths"
        )
    return question
