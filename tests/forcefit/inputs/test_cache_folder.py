"""Cache folder for meshes and link solutions, and runs without such a folder."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from forcefit.inputs import cache_folder as module
from forcefit.inputs.cache_folder import cache_folder

ROOT = Path(__file__).parents[3]


@pytest.fixture
def nothing(monkeypatch, tmp_path):
    """Remove all cache variables, and make the home folder unusable."""
    for name in ("FORCEFIT_CACHE", "LOCALAPPDATA", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    (tmp_path / "home").write_text("a file: nothing can be made in it")
    (tmp_path / "tmp").mkdir()
    monkeypatch.setattr(module.Path, "home", lambda: tmp_path / "home")
    monkeypatch.setattr(module.tempfile, "gettempdir", lambda: str(tmp_path / "tmp"))
    return tmp_path


def test_cache_folder_is_set_by_environment_variable(nothing, monkeypatch):
    monkeypatch.setenv("FORCEFIT_CACHE", str(nothing / "mine"))
    assert cache_folder() == nothing / "mine"
    # a folder that cannot be created is skipped
    monkeypatch.setenv("FORCEFIT_CACHE", str(nothing / "home" / "mine"))
    assert cache_folder().parent == nothing / "tmp"


@pytest.mark.parametrize(("system", "variable", "within"), [
    ("win32", "LOCALAPPDATA", ""), ("darwin", "", "Library/Caches"),
    ("linux", "XDG_CACHE_HOME", ".cache"),
])  # fmt: skip
def test_cache_folder_depends_on_operating_system(
    system, variable, within, nothing, monkeypatch
):
    monkeypatch.setattr(module.sys, "platform", system)
    monkeypatch.setattr(module.Path, "home", lambda: nothing / "me")
    assert cache_folder() == nothing / "me" / within / "forcefit"
    if variable:
        monkeypatch.setenv(variable, str(nothing / "other"))
        assert cache_folder() == nothing / "other" / "forcefit"


def test_cache_folder_without_home_is_a_private_temporary_folder(nothing, monkeypatch):
    def homeless():
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setattr(module.Path, "home", homeless)
    folder = cache_folder()
    assert folder.parent == nothing / "tmp"
    assert folder.stat().st_mode & 0o077 == 0


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="no users of POSIX")
def test_cache_folder_is_not_a_world_writable_folder(nothing):
    """Other users could replace the files in such a folder."""
    folder = cache_folder()
    folder.chmod(0o777)
    assert cache_folder() is None
    shutil.rmtree(folder)
    (nothing / "elsewhere").mkdir()
    folder.symlink_to(nothing / "elsewhere")
    assert cache_folder() is None


def test_cache_folder_is_none_without_a_writable_folder(nothing):
    shutil.rmtree(nothing / "tmp")
    assert cache_folder() is None


@pytest.mark.slow
@pytest.mark.parametrize("temporary", [True, False])
def test_solve_runs_in_a_read_only_installation(tmp_path, temporary):
    """Each ``__pycache__`` is a file, so that root cannot write compiled code."""
    for package in ("forcefit", "stiffness", "assembly", "validation"):
        shutil.copytree(ROOT / package, tmp_path / package,
                        ignore=shutil.ignore_patterns("__pycache__"))  # fmt: skip
        for folder in [tmp_path / package, *(tmp_path / package).rglob("*/")]:
            (folder / "__pycache__").write_text("a file")
    (tmp_path / "tmp").mkdir()
    given = {k: v for k, v in os.environ.items() if not k.endswith("CACHE_DIR")}
    given |= {"PYTHONPATH": str(tmp_path), "HOME": "/dev/null", "OMP_NUM_THREADS": "1",
              "XDG_CACHE_HOME": "/dev/null/x", "FORCEFIT_CACHE": "/dev/null/x",
              "TMPDIR": str(tmp_path / "tmp")}  # fmt: skip
    code = "from forcefit.commands.app import main; main()"
    if not temporary:
        code = f"import tempfile; tempfile.tempdir = '/dev/null'; {code}"
    done = subprocess.run(
        [sys.executable, "-c", code, "assembly", "solve", "five_bar",
         "--quantities", "margin"], env=given,
        capture_output=True, text=True, cwd=tmp_path, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "zone margin, compliant joints free" in done.stdout
    assert "Traceback" not in done.stderr
