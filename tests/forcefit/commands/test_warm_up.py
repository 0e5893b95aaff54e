"""Compiled functions: all compiled beforehand, once, by one process of many."""

import os
import subprocess
import sys
from pathlib import Path

import pytest


def compile_at_once(command, cache):
    """Three processes on an empty cache, then a fourth.

    By process: how often it says that it compiles, and its standard output.
    """
    given = {"env": os.environ | {"NUMBA_CACHE_DIR": str(cache)}, "text": True,
             "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}  # fmt: skip
    said, written = [], []
    for count in (3, 1):
        for process in [subprocess.Popen(command, **given) for _ in range(count)]:
            out, err = process.communicate(timeout=900)
            assert process.returncode == 0, err
            said.append(err.count("compiling its solvers"))
            written.append(out)
    return said, written


@pytest.mark.slow
def test_processes_that_compile_at_once_leave_everything_compiled(tmp_path):
    """The fourth then compiles nothing, and says nothing."""
    command = [sys.executable, "-m", "forcefit", "warm-up"]
    assert compile_at_once(command, tmp_path)[0] == [1, 1, 1, 0]


QUARTER = """
import importlib.util, os, pathlib, sys, time
import numpy as np
if __name__ == "__main__":
    spec = importlib.util.spec_from_file_location("assembly.quarter", __file__)
    module = sys.modules[spec.name] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    folder = pathlib.Path(__file__).parent
    (folder / f"ready.{os.getpid()}").touch()
    end = time.monotonic() + 60
    while len(list(folder.glob("ready.*"))) < 3 and time.monotonic() < end:
        time.sleep(0.01)
    print(module.quarter(np.array([12.0])))
else:
    from assembly.solvers.compiled import kernel, part
    from assembly.solvers.layouts import Vector

    @part
    def half(v: Vector) -> float:
        return v[0] / 2

    @kernel
    def quarter(v):
        return half(v) / 2
"""


@pytest.mark.slow
def test_processes_that_compile_one_kernel_at_once_leave_it_compiled(tmp_path):
    """The same with a kernel of one line and its part, in one file each.

    One of the three may come so late that it finds them compiled.
    """
    (tmp_path / "quarter.py").write_text(QUARTER)
    command = [sys.executable, str(tmp_path / "quarter.py")]
    said, written = compile_at_once(command, tmp_path / "cache")
    assert written == ["3.0\n"] * 4
    assert max(said) == 1
    assert said[-1] == 0
    compiled = [path.name for path in (tmp_path / "cache").rglob("*.nbc")]
    assert sorted(name.partition("-")[0] for name in compiled) == [
        "quarter.half", "quarter.quarter"
    ]  # fmt: skip


def test_warming_up_runs_to_its_end(run):
    """Each computation with the arguments that its kernels take today."""
    status, _, err = run("warm-up")
    assert status == 0, err


@pytest.mark.slow
def test_every_compiled_function_is_warmed_up_and_has_one_signature(tmp_path):
    """Others would be compiled later, or by each process under the same name."""
    code = """
import importlib, pathlib, forcefit.commands.warm_up
from numba.core.dispatcher import Dispatcher
forcefit.commands.warm_up.warm_up()
for path in sorted(pathlib.Path("assembly").rglob("*.py")):
    if "import kernel" in path.read_text():
        module = importlib.import_module(".".join(path.with_suffix("").parts))
        for name, one in vars(module).items():
            if isinstance(one, Dispatcher) and len(one.signatures) != 1:
                print(module.__name__, name, len(one.signatures))
"""
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    run = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True,
        cwd=Path(__file__).parents[3], check=True,
    )  # fmt: skip
    assert run.stdout == ""
