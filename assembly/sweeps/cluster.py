"""Blocks of a sweep on many processes: Dask distributed, here or on a cluster.

The client keeps a few tasks in flight for each worker and journals what comes back,
so neither it nor a worker ever holds more than a few blocks.  A task is as many blocks
as take about half a second.  A worker that dies takes nothing with it: Dask gives its
tasks to others.  How blocks are spread changes no number: each process computes on one
thread, and points do not depend on their neighbours.
"""

import logging
import pickle
import signal
import threading
import time
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager
from functools import lru_cache
from importlib.metadata import version
from itertools import islice
from typing import TYPE_CHECKING, Any

from assembly.sweeps.identity import program_hash, question_hash
from assembly.sweeps.plan import Sweep
from assembly.sweeps.points import Found, Points, solve_points
from assembly.sweeps.quantities import Question
from assembly.sweeps.sweep import Solver
from forcefit.inputs.table import BadInput

if TYPE_CHECKING:
    import distributed

_TASK = 0.5  # [s] that a task should take; Dask asks for 0.1 at least
_IN_FLIGHT = 3  # tasks for each thread of the cluster
_LARGEST = 256  # blocks in a task
_PATIENCE = 60.0  # [s] to wait for a first worker

Task = tuple[int, Points]


def cluster_solver(
    workers: int | None = None,
    scheduler: str | None = None,
    report: Callable[[str], None] = lambda text: None,
) -> Solver:
    """A solver for :func:`assembly.sweeps.sweep.run_sweep` that uses a cluster.

    Args:
        workers: number of processes of a cluster started here, or
        scheduler: address of one that runs, such as ``tcp://10.0.0.1:8786``.
        report: called with a line when the sweep is done: tasks, their median time.

    Returns:
        The solver; the cluster is asked for, or started, when it begins.
    """

    def solve(sweep: Sweep, blocks: Iterable[int]) -> Iterator[tuple[int, Found]]:
        from distributed import Client, LocalCluster

        # what matters of it is said by the sweep, in one message
        logging.getLogger("distributed.client").setLevel(logging.CRITICAL)
        if scheduler is not None:
            with _connected(scheduler) as client:
                yield from _connected_spread(client, sweep, iter(blocks), report)
            return
        with _without_interrupts():
            here = LocalCluster(
                n_workers=workers, threads_per_worker=1, processes=True,
                dashboard_address=None, silence_logs=50,
            )  # fmt: skip
        with here as cluster, Client(cluster) as client:
            yield from _connected_spread(client, sweep, iter(blocks), report)

    return solve


@contextmanager
def _without_interrupts() -> Generator[None, None, None]:
    """Processes started meanwhile ignore Ctrl-C: it is the sweep's to stop them."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _connected(address: str) -> "distributed.Client":
    """A client of a scheduler that runs somewhere."""
    from distributed import Client

    try:
        return Client(address, timeout=10)
    except (OSError, ValueError, TimeoutError) as error:
        reason = str(error).partition("\n")[0][:200] or "no answer"
        raise BadInput(
            f"--scheduler {address[:80]}: cannot be reached: {reason}"
        ) from None


def _connected_spread(
    client: "distributed.Client",
    sweep: Sweep,
    blocks: Iterator[int],
    report: Callable[[str], None],
) -> Iterator[tuple[int, Found]]:
    """Hand out blocks; a scheduler that goes away is one message."""
    from distributed.comm import CommClosedError

    try:
        yield from _spread(client, sweep, blocks, report)
    except (CommClosedError, CancelledError):
        raise BadInput(
            "sweep: the connection to the scheduler was lost; finished points are in "
            "the journal, the same command goes on"
        ) from None


def _spread(
    client: "distributed.Client",
    sweep: Sweep,
    blocks: Iterator[int],
    report: Callable[[str], None],
) -> Iterator[tuple[int, Found]]:
    """Hand out blocks as workers become free; what is found comes in any order."""
    from distributed import KilledWorker, as_completed

    _check_workers(client)
    question = pickle.dumps(sweep.question), question_hash(sweep.question)
    size, flying, times = 1, 0, []
    waiting: Any = as_completed()

    def hand_out() -> None:
        nonlocal flying
        # asked each time: clusters grow and shrink
        threads = max(1, sum(client.nthreads().values()))
        while flying < _IN_FLIGHT * threads and (some := list(islice(blocks, size))):
            tasks = [(block, sweep.points(block)) for block in some]
            waiting.add(client.submit(solve_task, *question, tasks, pure=False))
            flying += 1

    hand_out()
    for future in waiting:
        try:
            seconds, found = future.result()
        except KilledWorker:
            raise BadInput(
                "sweep: some points killed every worker they were given to, as "
                "when memory runs out; the journal keeps all others"
            ) from None
        future.release()
        flying -= 1
        times.append(seconds)
        per_block = seconds / len(found)
        size = int(min(_LARGEST, max(1.0, _TASK / max(per_block, 1e-6))))
        yield from found
        hand_out()
    if times:
        median = sorted(times)[len(times) // 2]
        report(f"{len(times)} tasks, {median:.2g} s each")


def _check_workers(client: "distributed.Client") -> None:
    """Refuse a cluster without workers, or with another program on them."""
    try:
        client.wait_for_workers(1, timeout=_PATIENCE)
    except TimeoutError:
        raise BadInput(
            f"sweep: no worker joined the scheduler in {_PATIENCE:.0f} s"
        ) from None
    ours = _program()
    for worker, theirs in client.run(_program).items():
        if theirs != ours:
            raise BadInput(f"sweep: worker {worker} has {theirs}, expected {ours}")


def _program() -> str:
    """The program here: its version, and which sources and libraries it is made of."""
    return f"forcefit {version('forcefit')}, program_sha256 {program_hash()[:12]}"


def solve_task(
    question: bytes, digest: str, tasks: list[Task]
) -> tuple[float, list[tuple[int, Found]]]:
    """On a worker: solve some blocks on one thread.

    Args:
        question: pickled.
        digest: of the question where it was asked.
        tasks: number and points of each block.

    Returns:
        [s] that it took, and each block's number with what was found.

    Raises:
        BadInput: the question is another one here: a mesh or a library differs.
    """
    from threadpoolctl import threadpool_limits

    asked = _question(question, digest)
    start = time.perf_counter()
    with threadpool_limits(1):
        found = [(block, solve_points(asked, points)) for block, points in tasks]
    return time.perf_counter() - start, found


@lru_cache(maxsize=4)
def _question(content: bytes, digest: str) -> Question:
    """The question, unpacked once on each worker: robots are prepared by identity."""
    question: Question = pickle.loads(content)
    if question_hash(question) != digest:
        raise BadInput(
            "sweep: a worker reads another robot; expected its meshes and stiffness "
            "libraries to be the same there, at the same paths"
        )
    return question
