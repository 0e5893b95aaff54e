"""Files are written completely or not at all."""

import ast
import multiprocessing
import os
import resource
import signal
import time
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from forcefit.assembly.files.robot_file import read_robot, write_robot
from forcefit.assembly.robots import load_robot
from forcefit.inputs.table import BadInput
from forcefit.inputs.writing import (
    JSON,
    PIXELS,
    ROBOT,
    check_writable,
    path_from,
    save_figure,
    save_pixels,
    whole_file,
    write_json,
    write_text,
)

ROOT = Path(__file__).parents[3]
# functions that write files, and modules in which they are allowed
_WRITERS = {"write_text", "write_bytes", "savefig", "to_netcdf", "screenshot", "dump",
            "imsave", "savez", "savez_compressed", "dump_to_store"}  # fmt: skip
_MAY = {
    "forcefit/inputs/writing.py",
    "stiffness/mesh/mesh.py",  # cache written with whole_file, and temporary files
    "stiffness/mesh/mesh_worker.py",  # likewise
    "stiffness/surface/surface_worker.py",  # writes to a temporary folder
    "assembly/files/stored_solutions.py",  # uses whole_file
    "assembly/sweeps/dataset.py",  # uses whole_file
    "forcefit/commands/show.py",  # takes a screenshot without writing a file
    "assembly/report/plot_closing.py",  # likewise
    "forcefit/page/page.py",  # writes to memory
    "assembly/statistics/replay.py",  # likewise
    "validation/study/report.py",  # likewise
    "validation/diagnosis/saved_covariance.py",  # likewise
    "assembly/exchange/comparison.py",  # writes to a temporary folder
    "assembly/exchange/mujoco_reading.py",  # likewise
    "assembly/exchange/robot_files.py",  # likewise
}


def written_elsewhere(path):
    """Yield calls that write files without ``forcefit/inputs/writing.py``."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            if node.func.attr in _WRITERS:
                yield f"{path.relative_to(ROOT)}:{node.lineno} {node.func.attr}"


def test_only_the_writing_module_writes_files():
    files = [p for f in ("stiffness", "assembly", "validation") for p in
             (ROOT / f).rglob("*.py")]  # fmt: skip
    files = [p for p in files if p.relative_to(ROOT).as_posix() not in _MAY]
    assert [said for path in files for said in written_elsewhere(path)] == []


@contextmanager
def full_disk():
    """Limit the size of all files that this process writes to 512 bytes."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (512, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def a_figure(title=""):
    from matplotlib.figure import Figure

    figure = Figure()
    figure.suptitle(title)
    figure.subplots().plot(np.arange(20) ** 2)
    return figure


def a_dataset(path):
    import xarray

    from forcefit.assembly.sweeps.dataset import save_dataset

    save_dataset(xarray.Dataset({"x": ("i", np.arange(1000.0))}), path)


# first bytes of existing files that may be overwritten
WRITTEN = {
    ".png": b"\x89PNG\r\n", ".svg": b"<?xml", ".pdf": b"%PDF-",
    ".toml": b"# Written by forcefit.\n",
}  # fmt: skip
WRITE = {
    "text.txt": lambda path: write_text("x" * 4000, path),
    "found.json": lambda path: write_json({"x": list(range(999))}, str(path)),
    "robot.toml": lambda path: write_robot(load_robot("irsbot2"), path),
    "picture.png": lambda path: save_figure(a_figure(), path),
    "picture.svg": lambda path: save_figure(a_figure(), path),
    "picture.pdf": lambda path: save_figure(a_figure(), path),
    "pixels.png": lambda path: save_pixels(
        np.random.default_rng(0).integers(0, 255, (40, 40, 3), np.uint8), path
    ),
    "data.nc": a_dataset,
}  # fmt: skip


@pytest.mark.parametrize("name", WRITE)
@pytest.mark.parametrize("before", [None, b"what stood there\n"])
def test_old_file_is_unchanged_if_the_disk_is_full(tmp_path, name, before):
    path = tmp_path / name
    if before is not None:
        path.write_bytes(WRITTEN.get(path.suffix, before))
        before = path.read_bytes()
    with full_disk(), pytest.raises(BadInput) as error:
        WRITE[name](path)
    assert str(error.value).startswith(f"{path}: cannot be written: ")
    left = [p.read_bytes() for p in tmp_path.iterdir()]
    assert left == ([] if before is None else [before])


@pytest.mark.parametrize("name", WRITE)
def test_no_temporary_file_remains_after_writing(tmp_path, name):
    WRITE[name](tmp_path / name)
    assert [p.name for p in tmp_path.iterdir()] == [name]
    assert (tmp_path / name).stat().st_size > 500


@pytest.mark.parametrize("ending", PIXELS.endings)
def test_picture_of_every_format_is_written_and_overwritten(tmp_path, ending):
    path = tmp_path / f"picture{ending.upper()}"
    for shade in (0, 255):
        save_pixels(np.full((5, 7, 3), shade, np.uint8), path)
        check_writable(path, PIXELS)
        shown = np.asarray(Image.open(path).convert("RGB"))
        assert shown.shape == (5, 7, 3)
        assert (abs(shown.astype(int) - shade) <= 2).all()  # JPEG is lossy


def fail_in(path):
    with whole_file(path) as part:
        part.write_text("half")
        raise KeyboardInterrupt


def test_old_file_is_unchanged_if_writing_fails(tmp_path):
    path = tmp_path / "x.txt"
    path.write_text("old")
    with pytest.raises(KeyboardInterrupt):
        fail_in(path)
    assert [p.read_text() for p in tmp_path.iterdir()] == ["old"]


def test_overwriting_preserves_mode_and_symbolic_link(tmp_path):
    path, link = tmp_path / "real.json", tmp_path / "link.json"
    path.write_text("{}")
    path.chmod(0o600)
    link.symlink_to(path)
    write_json({"a": 1}, str(link))
    assert link.is_symlink()
    assert path.read_text() == '{\n "a": 1\n}\n'
    assert path.stat().st_mode & 0o777 == 0o600


@pytest.mark.parametrize("device", ["/dev/null", "/dev/full"])
def test_device_file_is_rejected(tmp_path, device):
    for target in (Path(device), tmp_path / "link"):
        if target.name == "link":
            target.symlink_to(device)
        with pytest.raises(BadInput, match="found a device, pipe or socket"):
            write_text("x", target)
    assert Path(device).is_char_device()


def test_pipe_is_rejected_without_waiting(tmp_path):
    os.mkfifo(tmp_path / "x.json")
    with pytest.raises(BadInput, match="found a device, pipe or socket"):
        write_json({}, str(tmp_path / "x.json"))


def test_handwritten_robot_file_is_not_overwritten(tmp_path):
    path = tmp_path / "robot.toml"
    write_robot(load_robot("five_bar"), path)
    check_writable(path, ROBOT)
    assert read_robot(path).name == "five_bar"
    path.write_text('name = "mine"\n')
    with pytest.raises(BadInput, match="found a file that is not a robot file written"):
        check_writable(path, ROBOT)


def test_invalid_paths_are_rejected():
    for path in ("a\0b.json", "x" * 300 + ".json", "", ".", "/dev/null/x.json"):
        with pytest.raises(BadInput):
            check_writable(path, JSON)


def test_invalid_utf_8_is_escaped(tmp_path):
    write_text("name \udcff\n", tmp_path / "x.txt")
    assert (tmp_path / "x.txt").read_bytes() == b"name \\udcff\n"


def write_many(path, mark, count):
    for _ in range(count):
        write_text(mark * 30_000, path)


def test_two_processes_write_one_complete_file(tmp_path):
    """Each process waits for the other, and no temporary file remains."""
    path, fork = tmp_path / "x.txt", multiprocessing.get_context("fork")
    both = [fork.Process(target=write_many, args=(path, mark, 30)) for mark in "ab"]
    for one in both:
        one.start()
    seen = set()
    while any(one.is_alive() for one in both):
        if path.exists():
            seen.add(path.read_text())
    for one in both:
        one.join()
    assert [one.exitcode for one in both] == [0, 0]
    assert seen <= {"a" * 30_000, "b" * 30_000}
    assert [p.name for p in tmp_path.iterdir()] == ["x.txt"]


def test_part_file_of_a_killed_process_is_overwritten(tmp_path):
    path = tmp_path / "x.txt"
    child = os.fork()
    if not child:
        with whole_file(path) as part:
            part.write_text("half" * 1000)
            os.kill(os.getpid(), signal.SIGKILL)
            time.sleep(60)
    os.waitpid(child, 0)
    left = sorted(p.name for p in tmp_path.iterdir())
    assert left == ["x.txt.part", "x.txt.part.lock"]
    write_text("whole", path)
    assert [p.read_text() for p in tmp_path.iterdir()] == ["whole"]


def test_relative_path_has_slashes(tmp_path, monkeypatch):
    assert path_from(tmp_path / "a" / "b", tmp_path / "c.stl") == "../../c.stl"

    def another_drive(*given):
        raise ValueError("path is on mount 'D:', start on mount 'C:'")

    monkeypatch.setattr("os.path.relpath", another_drive)
    assert path_from(tmp_path, "/c.stl") == "/c.stl"
