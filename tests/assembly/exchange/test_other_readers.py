"""A distribution that is installed reads robots of its own files."""

import json
import sys

import numpy as np
import pytest

import forcefit as ff
from forcefit.inputs.errors import BadInput

MODULE = """
from pathlib import Path
import forcefit as ff
from forcefit.inputs.errors import BadInput

def read(path):
    lengths = [float(word) for word in Path(path).read_text().split()]
    if not lengths:
        raise BadInput(f"{path}: found no lengths")
    frames, parent = [], "base"
    for i, length in enumerate(lengths):
        moves = i < len(lengths) - 1
        frames.append(ff.Frame(f"j{i}", parent, translation=[length, 0, 0],
                               joint="revolute" if moves else "fixed", actuated=moves))
        parent = f"j{i}"
    return ff.Robot("chain", parent, tuple(frames))

def wrong(path):
    return 3
"""


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """Return a function that installs a distribution of a name with entry points."""
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "their_reader.py").write_text(MODULE)

    def install(name, **readers):
        folder = tmp_path / f"{name}-1.0.dist-info"
        folder.mkdir()
        (folder / "METADATA").write_text(f"Name: {name}\nVersion: 1.0\n")
        lines = [f"{ending} = {what}" for ending, what in readers.items()]
        text = "\n".join(["[forcefit.readers]", *lines])
        (folder / "entry_points.txt").write_text(text)

    yield install
    sys.modules.pop("their_reader", None)


def test_every_command_accepts_a_file_of_an_installed_reader(installed, run, tmp_path):
    """The chain lies along x: its end is at the sum of the lengths."""
    installed("their-robots", chain="their_reader:read")
    path = tmp_path / "arm.CHAIN"
    path.write_text("0.3 0.2 0.15")
    robot = ff.load_robot(path)
    assert ff.place_robot(robot).pose()["tx"] == pytest.approx(0.65)
    status, _, err = run("assembly", "solve", path, "--json", tmp_path / "o.json")
    assert (status, err) == (0, "")
    solved = json.loads((tmp_path / "o.json").read_text())
    assert solved["pose"]["tx"] == pytest.approx(0.65)
    swept = ff.sweep(path, grid="q.j0=0:0.2:0.1", vary=["j1.translation.x=0.1,0.2"],
                     quantities=["energy"])  # fmt: skip
    assert np.all(swept.energy.values == 0.0)


def test_message_of_an_installed_reader_is_shown_to_the_user(installed, run, tmp_path):
    installed("their-robots", chain="their_reader:read")
    (tmp_path / "arm.chain").write_text("")
    status, out, err = run("assembly", "solve", tmp_path / "arm.chain")
    assert (status, out) == (2, "")
    assert err.endswith(f"{tmp_path / 'arm.chain'}: found no lengths\n")


@pytest.mark.parametrize(
    ("reader", "message"),
    [
        ("their_reader:wrong", "of their-robots returned int, expected a Robot"),
        ("their_reader:absent", "of their-robots cannot be imported: "),
        ("no_such_module:read", "of their-robots cannot be imported: No module named"),
    ],
)
def test_message_about_an_unusable_reader_names_the_reader(
    reader, message, installed, tmp_path
):
    installed("their-robots", chain=reader)
    (tmp_path / "arm.chain").write_text("1")
    with pytest.raises(BadInput, match=message):
        ff.load_robot(tmp_path / "arm.chain")


def test_message_about_two_readers_of_one_file_ending_names_both(installed, tmp_path):
    for name in ("theirs", "others"):
        installed(name, chain="their_reader:read")
    (tmp_path / "arm.chain").write_text("1")
    with pytest.raises(BadInput, match=r"reader chain in others and theirs"):
        ff.load_robot(tmp_path / "arm.chain")


def test_installed_reader_cannot_replace_a_file_ending_that_forcefit_reads(
    installed, tmp_path
):
    installed("theirs", toml="their_reader:wrong", urdf="their_reader:wrong")
    ff.write_robot(ff.load_robot("arm6"), tmp_path / "arm.toml")
    ff.write_robot(ff.load_robot("arm6"), tmp_path / "arm.urdf")
    for name in ("arm.toml", "arm.urdf"):
        assert len(ff.load_robot(tmp_path / name).frames) > 5
