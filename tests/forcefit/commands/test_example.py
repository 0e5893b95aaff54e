"""Command ``forcefit example``, which writes the files of examples."""

import tomllib
from pathlib import Path

import pytest

from forcefit.commands.example import EXAMPLES

ROOT = Path(__file__).parents[3]


def files_of(folder):
    return {
        path.relative_to(folder).as_posix()
        for path in folder.rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }


def test_every_file_of_the_examples_folder_belongs_to_an_example(run, tmp_path):
    status, out, err = run("example", *EXAMPLES, "-o", tmp_path)
    assert (status, err) == (0, "")
    assert files_of(tmp_path / "examples") == files_of(ROOT / "examples")
    for path in files_of(tmp_path):
        assert (tmp_path / path).read_bytes() == (ROOT / path).read_bytes(), path
    for one in EXAMPLES.values():
        assert one.first in out


@pytest.mark.parametrize("name", EXAMPLES)
def test_example_includes_all_files_that_it_refers_to(run, tmp_path, name):
    """TOML files refer to surfaces, robots and measurements."""
    run("example", name, "-o", tmp_path)
    for path in tmp_path.rglob("*.toml"):
        if path.name == "data.toml":  # lists files that are downloaded
            continue
        for value in strings(tomllib.loads(path.read_text(encoding="utf-8"))):
            if value.endswith((".stl", ".csv", ".toml")):
                assert (path.parent / value).is_file(), f"{path}: {value}"


def strings(value):
    if isinstance(value, dict):
        value = list(value.values())
    if isinstance(value, list):
        for one in value:
            yield from strings(one)
    elif isinstance(value, str):
        yield value


def test_example_command_without_a_name_lists_the_examples(run):
    status, out, _ = run("example")
    assert status == 0
    assert [line.split()[0] for line in out.splitlines()] == list(EXAMPLES)


def test_example_does_not_overwrite_edited_files(run, tmp_path):
    assert run("example", "irsbot2", "-o", tmp_path)[0] == 0
    before = files_of(tmp_path)
    status, out, _ = run("example", "irsbot2", "-o", tmp_path)
    assert (status, files_of(tmp_path)) == (0, before)
    assert out.startswith("0 files written")
    mine = tmp_path / "examples" / "irsbot2.toml"
    mine.write_text("mine")
    status, out, err = run("example", "campaign", "irsbot2", "-o", tmp_path)
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert f"{mine}: found a file whose content differs" in err
    assert files_of(tmp_path) == before


def test_wheel_includes_all_examples():
    table = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    packages = table["tool"]["scikit-build"]["wheel"]["packages"]
    tops = {part.split("/")[0] for one in EXAMPLES.values() for part in one.files}
    assert {f"forcefit/{top}": top for top in tops}.items() <= packages.items()
