"""Parallel computation of a sweep with Dask, on this machine or on a cluster.

The client submits only a few tasks per worker at a time and writes their results to the
journal, so neither the client nor a worker holds more than a few blocks in memory.  A
task contains as many blocks as can be solved in about half a second. The last tasks are
smaller, so that workers finish at nearly the same time.  Dask reassigns the tasks of a
lost worker.  How blocks are distributed does not affect any result, because each
process computes on one thread and points do not depend on neighbouring points.
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

_TASK = 0.5  # [s] target duration of a task; Dask recommends at least 0.1
_IN_FLIGHT = 3  # number of submitted tasks per thread of the cluster
_LARGEST = 256  # largest number of blocks per task
_LAST = 2  # number of tasks per thread into which the last blocks are divided
# Dask's profiler samples every 10 ms, which makes workers about 3 % slower
_QUIET = {"distributed.worker.profile.enabled": False}
_PATIENCE = 60.0  # [s] longest wait for the first worker

Task = tuple[int, Points]


def cluster_solver(
    workers: int | None = None,
    scheduler: str | None = None,
    report: Callable[[str], None] = lambda text: None,
) -> Solver:
    """Return a solver for :func:`.sweep.run_sweep` on a cluster.

    Args:
        workers: number of processes of a local cluster to start; None if
            ``scheduler`` is given.
        scheduler: address of a running cluster, such as ``tcp://10.0.0.1:8786``.
        report: callback that receives a final line of text with the number of tasks and
            their median duration.

    Returns:
        The solver, which connects to the cluster, or starts it, when first used.
    """

    def solve(
        sweep: Sweep, blocks: Iterable[int]
    ) -> Iterator[tuple[int, SolvedPoints]]:
        import dask
        from distributed import Client, LocalCluster

        # the sweep itself reports failures, in one message
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
    """Make processes started in the block ignore Ctrl-C; the sweep terminates them."""
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
    """Distribute blocks; if the scheduler is lost, report this in a single error."""
    from distributed.comm import CommClosedError

    try:
        yield from _distribute(client, sweep, blocks, report)
    except (CommClosedError, CancelledError):
        raise BadInput(
            "sweep: the connection to the scheduler was lost; finished points "
            "are in the journal: run the same command again to continue"
        ) from None


def _distribute(
    client: "distributed.Client",
    sweep: Sweep,
    blocks: list[int],
    report: Callable[[str], None],
) -> Iterator[tuple[int, SolvedPoints]]:
    """Submit blocks as workers become free, and yield results in any order."""
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
                "sweep: some points ended every worker that computed them, for "
                "example because memory ran out; the journal keeps all other "
                "points"
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
    """Return the total number of threads of the current workers, which may change."""
    from distributed.comm import CommClosedError

    try:
        return max(1, sum(client.nthreads().values()))
    except OSError as error:  # a lost scheduler does not answer this query either
        raise CommClosedError(str(error)) from error


def _check_workers(client: "distributed.Client") -> None:
    """Reject a cluster without workers or with workers of another program version."""
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
    """Return the program version and the digest of its sources and libraries."""
    return {
        "program": f"forcefit {version('forcefit')}",
        "program_sha256": program_hash(),
    }


def solve_task(
    question: bytes, digest: str, tasks: list[Task]
) -> tuple[float, list[tuple[int, SolvedPoints]]]:
    """Solve the blocks of a task on one thread of a worker.

    Args:
        question: pickled quantities of the sweep.
        digest: digest of these quantities on the client.
        tasks: number and points of each block.

    Returns:
        Computation time [s], and the number of each block with its results.

    Raises:
        BadInput: the digest on this worker differs, because a mesh or a stiffness
            library differs.
    """
    from threadpoolctl import threadpool_limits

    asked = _question(question, digest)
    start = time.perf_counter()
    with threadpool_limits(1):
        solved = [(block, solve_points(asked, points)) for block, points in tasks]
    return time.perf_counter() - start, solved


@lru_cache(maxsize=4)
def _question(content: bytes, digest: str) -> Question:
    """Return the unpickled quantities, cached so that each worker has one robot."""
    asked: Question = pickle.loads(content)
    question = replace(asked, robot=solve_links(asked.robot))
    if question_hash(question) != digest:
        raise BadInput(
            "sweep: found another robot on a worker; expected the same meshes "
            "and stiffness libraries there, at the same paths"
        )
    return question
