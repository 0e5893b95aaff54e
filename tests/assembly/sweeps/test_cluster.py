"""Sweeps on several processes, including failures of workers and of the scheduler."""

import os
import pickle
import re
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from forcefit import BadInput, load_robot
from forcefit.assembly.model.error_distributions import tolerance_sources
from forcefit.assembly.sweeps.cluster import _check_workers, cluster_solver, solve_task
from forcefit.assembly.sweeps.plan import Sweep
from forcefit.assembly.sweeps.quantities import Question
from forcefit.assembly.sweeps.sweep import run_sweep
from forcefit.assembly.sweeps.targets import grid_targets, parse_grid

pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")


def drawn_sweep(grid):
    """Return a sweep of a five-bar robot with three random draws at each posture."""
    robot = load_robot("five_bar")
    targets = grid_targets(parse_grid(grid, robot))
    sources = tolerance_sources(robot, np.array([1e-2] * 3 + [1e-3] * 3))
    question = Question(robot, None, (), targets.names, sources, 7)
    return Sweep(question, targets, (), 3, block_size=32)


def test_worker_rejects_a_task_for_another_robot():
    """The digest of the robot differs, for example because a mesh file differs."""
    question = drawn_sweep("tx=0,ty=0.13").question
    with pytest.raises(
        BadInput, match="found different meshes or stiffness libraries on a worker"
    ):
        solve_task(pickle.dumps(question), "0" * 64, [])


def test_workers_with_different_sources_are_rejected():
    class Client:
        def __init__(self, **theirs):
            self.theirs = theirs

        def wait_for_workers(self, *_, **__):
            pass

        def run(self, program):
            return {"tcp://h:1": program() | self.theirs}

    with pytest.raises(BadInput, match=r"worker tcp://h:1 has forcefit .*, expected "):
        _check_workers(Client(program_sha256=64 * "0"))
    # Another version with the same sources is accepted.
    _check_workers(Client(program="forcefit 0.2.0.dev7+g1234567"))


@pytest.mark.slow
def test_unreachable_scheduler_is_rejected(tmp_path):
    sweep = drawn_sweep("tx=0,ty=0.13")
    for address in ("tcp://127.0.0.1:9", "nonsense:/"):
        with pytest.raises(BadInput, match="--scheduler .* cannot be reached"):
            run_sweep(sweep, tmp_path / "x.nc", solve=cluster_solver(scheduler=address))


class Cluster:
    """Scheduler and workers as separate processes on the local machine."""

    def __init__(self, folder, workers):
        self.folder = folder
        self.processes = []
        self.start("scheduler", "--port", "0", "--no-dashboard", "--host", "127.0.0.1")
        self.address = self.wait_for(r"Scheduler at: *(tcp://\S+)")
        for _ in range(workers):
            self.start("worker", self.address, "--nthreads", "1", "--no-nanny",
                       "--no-dashboard")  # fmt: skip

    def start(self, *words):
        with (self.folder / "log").open("a") as log:
            command = [sys.executable, "-m", "distributed.cli.dask_" + words[0]]
            env = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
            self.processes.append(subprocess.Popen(
                [*command, *words[1:]], stderr=log, stdout=log, cwd=self.folder, env=env
            ))  # fmt: skip

    def wait_for(self, pattern):
        end = time.monotonic() + 60
        while time.monotonic() < end:
            found = re.search(pattern, (self.folder / "log").read_text())
            if found:
                return found[1]
            time.sleep(0.1)
        raise AssertionError((self.folder / "log").read_text())

    def stop(self):
        for process in reversed(self.processes):
            process.kill()
            process.wait()


@pytest.fixture
def cluster(tmp_path):
    (tmp_path / "cluster").mkdir()
    running = Cluster(tmp_path / "cluster", workers=2)
    yield running
    running.stop()


@pytest.mark.slow
def test_sweep_with_a_killed_worker_writes_the_same_file(cluster, tmp_path):
    """One of two workers receives SIGKILL."""
    sweep = drawn_sweep("tx=-0.045:0.045:0.003,ty=0.10:0.15:0.003")
    run_sweep(sweep, tmp_path / "one.nc")
    killed = []

    def kill(done, total):
        if done > total / 4 and not killed:
            victim = cluster.processes[-1]
            os.kill(victim.pid, signal.SIGKILL)
            killed.append(done)

    run_sweep(
        sweep, tmp_path / "many.nc", kill, cluster_solver(scheduler=cluster.address)
    )
    assert killed
    assert killed[0] < sweep.size / 2
    assert cluster.processes[-1].wait(timeout=10) == -signal.SIGKILL
    one, many = ((tmp_path / f"{name}.nc").read_bytes() for name in ("one", "many"))
    assert one == many


@pytest.mark.slow
def test_lost_scheduler_is_reported_and_the_sweep_can_be_resumed(cluster, tmp_path):
    sweep = drawn_sweep("tx=-0.045:0.045:0.003,ty=0.10:0.15:0.003")
    kept = []

    def kill(done, _):
        kept.append(done)
        if done > 100:
            cluster.processes[0].kill()

    with pytest.raises(BadInput, match="connection to the scheduler was lost"):
        run_sweep(
            sweep, tmp_path / "map.nc", kill, cluster_solver(scheduler=cluster.address)
        )
    resumed = []
    run_sweep(sweep, tmp_path / "map.nc", lambda done, _: resumed.append(done))
    assert resumed[0] == kept[-1]
    assert resumed[-1] == sweep.size


@pytest.mark.slow
def test_local_workers_write_the_same_file_as_one_process(tmp_path):
    command = [sys.executable, "-m", "forcefit", "assembly", "sweep", "five_bar",
               "--grid", "tx=-0.04:0.04:0.004,ty=0.10:0.15:0.01"]  # fmt: skip
    for name, words in (("one", []), ("two", ["--workers", "2"])):
        done = subprocess.run(
            [*command, "-o", tmp_path / f"{name}.nc", *words], check=False,
            capture_output=True, text=True,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        assert "Traceback" not in done.stderr
        assert done.stdout.startswith("ok: ")
    one, two = ((tmp_path / f"{name}.nc").read_bytes() for name in ("one", "two"))
    assert one == two
