"""The map in the docs leads to functions and chapters that are there."""

import re
from importlib import import_module
from pathlib import Path

import forcefit as ff
from tests.test_layers import FLOORS

MAP = (Path(__file__).parents[1] / "docs" / "map.md").read_text("utf-8")


def test_every_function_on_the_map_exists():
    names = re.findall(r"`((?:forcefit|stiffness|assembly|validation)\.[\w.]+)`", MAP)
    functions = [name for name in names if name.count(".") > 1]
    assert len(functions) > 25
    for name in functions:
        module, _, function = name.rpartition(".")
        assert callable(getattr(import_module(module), function)), name


def test_every_chapter_is_on_the_map():
    chapters = [name for name in FLOORS if "/" in name]
    missing = [n for n in chapters if f"`{n}`" not in MAP and f"`{n[10:]}`" not in MAP]
    short = [n for n in missing if f"`{n.split('/')[1]}`" not in MAP]
    assert set(short) <= {"stiffness/screws", "stiffness/link"}


def test_the_public_names_are_all_there_and_nothing_else():
    assert set(dir(ff)) == set(ff.__all__)
    for name in dir(ff):
        assert getattr(ff, name) is not None
    assert {"load_robot", "solve_assembly", "diagnose"} <= set(dir(ff))
    assert "import_module" not in dir(ff)
