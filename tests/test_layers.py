"""Imports follow the contracts of pyproject.toml, and heavy imports are deferred."""

import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
LINTER = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]
FOLDERS = ("stiffness", "assembly", "validation", "forcefit")
MODULES = ("forcefit", "forcefit.stiffness", "forcefit.assembly", "forcefit.validation")
CONTRACTS = LINTER["contracts"]
(OWNED,) = (c["forbidden_modules"] for c in CONTRACTS if "large packages" in c["name"])
HEAVY = {*OWNED, "pyvista", "matplotlib"} - {"typer"}
# packages that are not needed to solve one posture
FOR_MANY = (
    "dask", "h5py", "pandas", "rich", "scipy.interpolate", "scipy.ndimage",
    "scipy.optimize", "scipy.spatial", "scipy.stats", "vtkmodules",
)  # fmt: skip
# for each contract: file, import added to it, and text in the linter report
BROKEN = {
    "layers of forcefit": [
        ("stiffness/link.py", "import forcefit.assembly.model.robot",
         "forcefit.stiffness.link -> forcefit.assembly.model.robot"),
        ("forcefit/inputs/errors.py", "from forcefit.page import page",
         "forcefit.inputs.errors -> forcefit.page.page"),
    ],
    "layers of stiffness": [
        ("stiffness/screws.py", "if x:\n from forcefit.stiffness import link",
         "forcefit.stiffness.screws -> forcefit.stiffness.link"),
    ],
    "layers of assembly": [
        ("assembly/model/frame.py", "from forcefit.assembly.linear.zone import x",
         "forcefit.assembly.model.frame -> forcefit.assembly.linear.zone"),
        ("assembly/lost/__init__.py", "", "- forcefit.assembly.lost"),
    ],
    "layers of validation": [
        ("validation/campaign/checks.py", "import forcefit.validation.study.study",
         "forcefit.validation.campaign.checks -> forcefit.validation.study.study"),
    ],
    "no cycles": [
        ("assembly/exchange/mjcf_joint.py",
         "from forcefit.assembly.exchange import mjcf",
         "No cycles are allowed in forcefit.assembly.exchange"),
        ("stiffness/fem/elements.py",
         "def f():\n from forcefit.stiffness.fem import fea",
         "No cycles are allowed in forcefit.stiffness.fem"),
    ],
    "the reduction does not import its results": [
        ("assembly/linear/reference/reduction.py",
         "import forcefit.assembly.linear.assembled",
         "forcefit.assembly.linear.reference.reduction -> "
         "forcefit.assembly.linear.assembled"),
    ],
    "the cross-check does not import the assembly models": [
        ("validation/multibody/simulation.py", "import forcefit.assembly.linear.energy",
         "forcefit.validation.multibody.simulation -> forcefit.assembly.linear.energy"),
        ("validation/synthetic/rest.py", "from forcefit.assembly.linear import zone",
         "forcefit.validation.synthetic.rest -> forcefit.assembly.linear.zone"),
    ],
    "assembly does not compute link stiffnesses": [
        ("assembly/linear/load.py",
         "def f():\n from forcefit.stiffness.fem.fea import x",
         "forcefit.assembly.linear.load -> forcefit.stiffness.fem.fea"),
    ],
    "large packages are imported only in some modules": [
        ("assembly/model/links.py", "import xarray as xr",
         "forcefit.assembly.model.links -> xarray"),
        ("assembly/linear/closure.py", "def f():\n from clarabel import y",
         "forcefit.assembly.linear.closure -> clarabel"),
    ],
}  # fmt: skip


def lint(tree):
    """Return the exit status and the report of import-linter."""
    code = "from importlinter.cli import lint_imports as f; exit(f(no_cache=True))"
    run = [sys.executable, "-c", code]
    wide = os.environ | {"COLUMNS": "200"}
    answer = subprocess.run(run, cwd=tree, env=wide, capture_output=True, text=True)
    return answer.returncode, answer.stdout + answer.stderr


def in_memory(code, tree):
    """Return the modules that a new Python process has imported after some code."""
    code = f"{code}\nimport sys; print(*sys.modules, file=sys.stderr)"
    run = [sys.executable, "-c", code]
    answer = subprocess.run(run, cwd=tree, capture_output=True, text=True, check=True)
    return set(answer.stderr.split())


def loaded(modules, tree):
    """Return the heavy packages imported by modules in a new Python process."""
    return sorted(HEAVY & in_memory(f"import {modules}", tree))


def test_every_import_of_the_project_is_allowed():
    status, report = lint(ROOT)
    assert status == 0, report


def test_every_forbidden_import_is_reported(tmp_path):
    """All contracts are violated in a copy of the sources."""
    for package in FOLDERS:
        only = shutil.ignore_patterns("*.so", "*.cpp", "*.h", "__pycache__")
        shutil.copytree(ROOT / package, tmp_path / package, symlinks=True, ignore=only)
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    types = "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n import clarabel\n"
    added = [case[:2] for cases in BROKEN.values() for case in cases]
    for file, code in [("stiffness/beam/beam.py", types), *added]:
        (tmp_path / file).parent.mkdir(exist_ok=True)
        with (tmp_path / file).open("a") as source:
            source.write(f"\n{code}\n")
    status, report = lint(tmp_path)
    assert status == 1
    _, *parts = re.split(r"\n(.+)\n-{9,}\n\n", report.partition("Broken contracts")[2])
    sections = dict(zip(parts[::2], parts[1::2], strict=True))
    assert set(BROKEN) == set(sections) == {each["name"] for each in CONTRACTS}
    for name, cases in BROKEN.items():
        for _, _, reported in cases:
            assert reported in sections[name]
    assert "forcefit.stiffness.beam.beam -> clarabel" not in report


@pytest.mark.parametrize("folder", FOLDERS)
def test_every_package_has_a_py_typed_file(folder):
    assert (ROOT / folder / "py.typed").is_file()


@pytest.mark.parametrize("module", MODULES)
def test_module_imports_no_heavy_package(module):
    assert loaded(module, ROOT) == []


@pytest.mark.slow
def test_all_modules_import_no_heavy_package():
    files = [path for folder in FOLDERS for path in (ROOT / folder).rglob("*.py")]
    names = [".".join(path.relative_to(ROOT).with_suffix("").parts) for path in files]
    modules = sorted(
        "forcefit." + name.removesuffix(".__init__").removeprefix("forcefit.")
        for name in names
        if name != "forcefit.__init__"
    )
    assert loaded(", ".join(modules), ROOT) == []


@pytest.mark.parametrize(
    ("words", "left_out"),
    [
        ("--help", ("numpy", "scipy", "rich")),
        ("--version", ("numpy", "scipy", "rich")),
        ("assembly solve --help", ("numpy", "scipy", "rich")),
        ("validation diagnose --help", ("numpy", "scipy", "rich")),
        ("stiffness beam --length 1 --radius 0.1 --young 1e9 --poisson 0.3",
         ("scipy",)),
        ("assembly solve irsbot2 --quantities margin; assembly error irsbot2; "
         "assembly solve irsbot2 --pose tx=0.1,tz=-0.5", FOR_MANY),
    ],
)  # fmt: skip
def test_command_imports_only_the_packages_that_it_uses(words, left_out):
    """Additional imports would slow down the start; see benchmarks/startup.py."""
    code = f"""
import sys
from forcefit.commands import app as command
for words in {words.split(";")}:
    sys.argv = ["forcefit", *words.split()]
    try:
        command.main()
    except SystemExit as done:
        assert not done.code
"""
    unwanted = HEAVY - {"clarabel"} | {*left_out}
    assert sorted(unwanted & in_memory(code, ROOT)) == []
