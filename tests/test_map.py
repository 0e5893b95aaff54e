"""The page ``docs/map.md`` names existing functions and all packages."""

import re
from importlib import import_module
from pathlib import Path

import forcefit as ff
from tests.test_layers import CONTRACTS, FOLDERS

DOCS = Path(__file__).parents[1] / "docs"
MAP = (DOCS / "map.md").read_text("utf-8")


def test_every_function_on_the_map_exists():
    names = re.findall(r"`((?:forcefit|stiffness|assembly|validation)\.[\w.]+)`", MAP)
    functions = [name for name in names if name.count(".") > 1]
    assert len(functions) > 25
    for name in functions:
        module, _, function = name.rpartition(".")
        assert callable(getattr(import_module(module), function)), name


def test_every_package_folder_is_on_the_map():
    chapters = [
        f"{package}/{layer}".removeprefix("forcefit.")
        for contract in CONTRACTS
        for package in contract.get("containers", ())
        for layer in contract["layers"]
        if layer not in FOLDERS
    ]
    assert len(chapters) > 30
    missing = [n for n in chapters if f"`{n}`" not in MAP and f"`{n[10:]}`" not in MAP]
    short = [n for n in missing if f"`{n.split('/')[1]}`" not in MAP]
    assert set(short) <= {"stiffness/screws", "stiffness/link"}


def test_every_public_name_is_in_the_reference():
    """Each page lists public names first, followed by names in their modules."""
    owned, others = [], []
    for path in DOCS.glob("api_*.md"):
        parts = path.read_text("utf-8").partition("## In their modules")
        for names, part in zip((owned, others), parts[::2], strict=True):
            names += re.findall(r"^::: ([\w.]+)\.(\w+)$", part, flags=re.M)
    assert sorted(name for _, name in owned) == sorted(set(dir(ff)) - {"__version__"})
    for module, name in owned:
        assert getattr(import_module(module), name) is getattr(ff, name)
    assert len(others) > 10
    for module, name in others:
        assert hasattr(import_module(module), name)
        assert name not in dir(ff)


def test_every_docs_page_is_listed_in_mkdocs():
    """A page that is missing in mkdocs.yml would not be published."""
    listed = (DOCS.parent / "mkdocs.yml").read_text("utf-8")
    pages = {path.relative_to(DOCS).as_posix() for path in DOCS.rglob("*.md")}
    assert {page for page in pages if f": {page}\n" not in listed} == set()


def test_dir_lists_exactly_the_public_names():
    assert set(dir(ff)) == set(ff.__all__)
    for name in dir(ff):
        assert getattr(ff, name) is not None
    assert {"load_robot", "solve_assembly", "diagnose"} <= set(dir(ff))
    assert "import_module" not in dir(ff)
