"""Compiled functions on disk."""

import pickle

import numba

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
