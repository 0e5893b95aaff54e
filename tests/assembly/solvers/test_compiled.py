"""Compiled functions on disk."""

import gc
import pickle

import numba
import pytest
from numba.core import event
from numba.core.codegen import CPUCodeLibrary

from assembly.solvers.compiled import kernel


def test_what_an_update_has_moved_is_compiled_anew(tmp_path, monkeypatch):
    """An index names the types of arguments; unpickled, it imports their modules."""
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))

    def double(x: float) -> float:
        return 2.0 * x

    kernel(double)(1.0)
    (index,) = tmp_path.rglob("*.nbi")
    version = pickle.dumps(numba.__version__)
    gone = b"cassembly.batch.many_postures\nEnergies\n."
    for damaged in (gone, b"cassembly.solvers.compiled\nGone\n.", b""):
        index.write_bytes(version + damaged)
        assert kernel(double)(1.5) == 3.0
        assert pickle.loads(index.read_bytes()) == numba.__version__
        assert len(index.read_bytes()) > len(version) + len(damaged)


def test_compiling_leaves_numba_and_the_collector_as_they_were(tmp_path, monkeypatch):
    """Also where compiling fails; what compiles in between works without either."""
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    optimize = CPUCodeLibrary._optimize_functions
    during = []

    def triple(x: float) -> float:
        return 3.0 * x

    def unknown(x: float) -> float:
        return x.nothing

    class Watch(event.Listener):
        def on_start(self, event):
            during.append(gc.isenabled())

        def on_end(self, event):
            pass

    with event.install_listener("numba:compile", Watch()):
        assert kernel(triple)(2.0) == 6.0
        with pytest.raises(numba.TypingError):
            kernel(unknown)(1.0)
    assert during == [False, False]
    assert gc.isenabled()
    assert CPUCodeLibrary._optimize_functions is optimize


def test_where_numba_is_told_not_to_compile_a_loop_is_its_python(monkeypatch):
    def double(x: float) -> float:
        return 2.0 * x

    monkeypatch.setattr(numba.config, "DISABLE_JIT", True)
    assert kernel(double) is double
    assert kernel(fastmath=True)(double) is double
