"""Arrows point down, each heavy package has one owner, and imports stay light."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
BELOW = {"stiffness": (), "assembly": ("stiffness",)}
BELOW["validation"] = ("stiffness", "assembly")
SIMULATION = "validation/multibody/simulation.py"
OWNERS = {
    "pytetwild": ("stiffness/mesh_worker.py",),
    "skfem": ("stiffness/lagrange.py",),
    "meshio": ("stiffness/surface_files.py",),
    "gmsh": ("stiffness/surface_files.py",),
    "clarabel": ("assembly/solvers/conic.py",),
    "cvxpy": (
        "assembly/reference.py",
        "assembly/statistics/cutting_planes.py",
        "assembly/statistics/worst_case.py",
    ),
    "exudyn": (SIMULATION,),
    "numba": (
        "assembly/solvers/compiled_reach.py",
        "assembly/solvers/farthest.py",
        "assembly/solvers/majorant.py",
        "assembly/solvers/polytope.py",
        "assembly/solvers/support.py",
        "assembly/solvers/interior.py",
        "assembly/continuation.py",
        "assembly/solvers/dual_newton.py",
        "assembly/solvers/compiled_assembly.py",
        "assembly/solvers/compiled_draws.py",
        "assembly/solvers/compiled_reduction.py",
        "assembly/solvers/compiled_zone.py",
        "assembly/statistics/hit_and_run.py",
        "assembly/solvers/householder.py",
    ),
    "xarray": (
        "assembly/sweeps/dataset.py",
        "assembly/statistics/monte_carlo.py",
        "assembly/statistics/importance.py",
        "assembly/statistics/tolerances.py",
        "stiffness/library.py",
    ),
    "h5netcdf": ("assembly/sweeps/netcdf.py",),
    "distributed": ("assembly/sweeps/cluster.py",),
}
HEAVY = (*OWNERS, "pyvista", "matplotlib")
# the second opinion must not share the first one's mechanics
INDEPENDENT = (
    "validation/multibody/",
    "validation/synthetic/effects.py",
    "validation/synthetic/machine.py",
    "validation/synthetic/outside.py",
    "validation/synthetic/rest.py",
)


def imports(path):
    """Modules a file imports, in functions too; not those for type checkers only."""
    waiting = [ast.parse(path.read_text(encoding="utf-8"))]
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            waiting += node.orelse
        else:
            waiting += ast.iter_child_nodes(node)


def wrong_imports(tree):
    """``file imports module`` for each import that is not allowed."""
    for folder, below in BELOW.items():
        for path in sorted((tree / folder).rglob("*.py")):
            file = path.relative_to(tree).as_posix()
            for module in imports(path):
                top = module.partition(".")[0]
                upward = top in {*BELOW, "forcefit"} and top not in (folder, *below)
                foreign = top in OWNERS and file not in OWNERS[top]
                alone = file.startswith(INDEPENDENT)
                shared = alone and top == "assembly"
                shared = shared and not f"{module}.".startswith("assembly.robot.")
                if upward or foreign or shared:
                    yield f"{file} imports {module}"


def loaded(modules, tree):
    """Heavy packages in memory after modules were imported in a fresh Python."""
    code = f"import sys, {modules}; print(*sys.modules)"
    run = [sys.executable, "-c", code]
    answer = subprocess.run(run, cwd=tree, capture_output=True, text=True, check=True)
    return sorted(set(HEAVY) & set(answer.stdout.split()))


def test_every_import_of_the_project_is_allowed():
    assert list(wrong_imports(ROOT)) == []


def test_every_folder_was_looked_at():
    """Otherwise a moved folder would pass unseen."""
    for folder in BELOW:
        modules = {m for p in (ROOT / folder).rglob("*.py") for m in imports(p)}
        assert any(m.startswith(("numpy", "stiffness")) for m in modules), folder


@pytest.mark.parametrize("module", [*BELOW, "forcefit"])
def test_nothing_heavy_is_imported_before_it_is_needed(module):
    assert loaded(module, ROOT) == []


def test_nothing_heavy_is_imported_with_all_files_at_once():
    files = [path for folder in BELOW for path in (ROOT / folder).rglob("*.py")]
    compiled = [ROOT / name for name in OWNERS["numba"]]  # nothing but compiled loops
    files = [path for path in files if path not in compiled]
    names = [".".join(path.relative_to(ROOT).with_suffix("").parts) for path in files]
    modules = sorted(name.removesuffix(".__init__") for name in names)
    assert loaded(", ".join(modules), ROOT) == []


@pytest.mark.parametrize(
    ("file", "code", "message"),
    [
        ("stiffness/a.py", "import assembly.robot", "imports assembly.robot"),
        ("stiffness/a.py", "def f():\n import forcefit", "imports forcefit"),
        ("assembly/a.py", "from validation import x", "imports validation.x"),
        ("assembly/a/b.py", "import xarray as xr", "imports xarray"),
        ("assembly/zone.py", "def f():\n from clarabel import y", "imports clarabel.y"),
        ("validation/a.py", "if x:\n import cvxpy", "imports cvxpy"),
        (
            "validation/multibody/simulation.py",
            "import assembly.energy",
            "imports assembly.en",
        ),
        (
            "validation/multibody/motion.py",
            "from assembly import zone",
            "imports assembly.z",
        ),
        (
            "validation/multibody/simulation.py",
            "import assembly.robot_file",
            "imports assembly.r",
        ),
    ],
)
def test_a_forbidden_import_is_found(file, code, message, tmp_path):
    """The walk above is broken on purpose, one rule at a time."""
    path = tmp_path / file
    path.parent.mkdir(parents=True)
    allowed = "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n import clarabel\n"
    path.write_text(f"import stiffness.screws\n{allowed}")
    assert list(wrong_imports(tmp_path)) == []
    path.write_text(code)
    (found,) = wrong_imports(tmp_path)
    assert found.startswith(f"{file} {message}")


def test_a_heavy_import_is_found(tmp_path):
    (tmp_path / "feather.py").write_text("import json\n")
    (tmp_path / "anvil.py").write_text("import matplotlib\n")
    assert loaded("feather", tmp_path) == []
    assert loaded("anvil", tmp_path) == ["matplotlib"]
