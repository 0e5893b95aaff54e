"""Arrows point down, each heavy package has one owner, and imports stay light."""

import ast
import subprocess
import sys
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
# from the ground up: a chapter imports only chapters before its own, and itself
FLOORS = (
    "forcefit/inputs", "forcefit/page",
    "stiffness/screws", "stiffness/link", "stiffness/beam", "stiffness/surface",
    "stiffness/mesh", "stiffness/fem", "stiffness/report", "stiffness/exchange",
    "assembly/kernels", "assembly/solvers", "assembly/model", "assembly/kinematics",
    "assembly/linear", "assembly/exact",
    "assembly/platform_stiffness", "assembly/report", "assembly/measurement",
    "assembly/effects", "assembly/files", "assembly/robots", "assembly/exchange",
    "assembly/sweeps",
    "assembly/statistics",
    "validation/multibody", "validation/crosscheck",
    "validation/assumptions", "validation/campaign", "validation/exchange",
    "validation/standards", "validation/synthetic",
    "validation/diagnosis", "validation/correction", "validation/inspection",
    "validation/study", "forcefit/commands",
)  # fmt: skip
PACKAGES = ("forcefit", "stiffness", "assembly", "validation")
SIMULATION = "validation/multibody/simulation.py"
OWNERS = {
    "pytetwild": ("stiffness/mesh/mesh_worker.py",),
    "meshio": ("stiffness/surface/surface_worker.py",),
    "gmsh": ("stiffness/surface/step_file.py",),
    "clarabel": ("assembly/solvers/conic.py",),
    "cvxpy": (
        "assembly/linear/reference/as_printed.py",
        "assembly/statistics/cutting_planes.py",
        "assembly/statistics/worst_case.py",
    ),
    "exudyn": (SIMULATION,),
    "xarray": (
        "assembly/sweeps/dataset.py",
        "assembly/statistics/monte_carlo.py",
        "assembly/statistics/importance_table.py",
        "assembly/statistics/allocated_tolerances.py",
        "assembly/model/tables.py",
    ),
    "pandas": ("assembly/model/tables.py",),
    "h5netcdf": ("assembly/sweeps/netcdf.py",),
    "distributed": ("assembly/sweeps/cluster.py",),
    "mujoco": ("assembly/exchange/mujoco_reading.py",),
}
HEAVY = (*OWNERS, "pyvista", "matplotlib")
# of use to sweeps, statistics, files and drawings, not to one posture
FOR_MANY = (
    "dask", "h5py", "pandas", "rich", "scipy.interpolate", "scipy.ndimage",
    "scipy.optimize", "scipy.spatial", "scipy.stats", "vtkmodules",
)  # fmt: skip
# of assembly, assembly/files alone: it finds links' stiffnesses when a robot is loaded
FOR_LOADING = ("stiffness.surface", "stiffness.mesh", "stiffness.report",
               "stiffness.fem.fea")  # fmt: skip
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
    return imports_of(path.read_text(encoding="utf-8"))


@cache
def imports_of(source):
    """The same of its text: tests of the whole tree parse it once."""
    modules = []
    waiting = [ast.parse(source)]
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.Import):
            modules += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            modules += [f"{node.module}.{alias.name}" for alias in node.names]
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            waiting += node.orelse
        else:
            waiting += ast.iter_child_nodes(node)
    return modules


def chapter(module):
    """Folder of a module, or the file that stands beside the folders, and its floor."""
    name = "/".join(module.split(".")[:2])
    return name, FLOORS.index(name) if name in FLOORS else None


def wrong_imports(tree):
    """``file imports module`` for each import that is not allowed."""
    for package in PACKAGES:
        for path in sorted((tree / package).rglob("*.py")):
            file = path.relative_to(tree).as_posix()
            # a package's own __init__.py and __main__.py hand on what stands below
            _, floor = chapter(file.removesuffix(".py").replace("/", "."))
            for module in imports(path):
                top = module.partition(".")[0]
                _, other = chapter(module)
                upward = top in PACKAGES and floor is not None and other is not None
                upward = upward and other > floor
                lost = top in PACKAGES and other is None and module.count(".") > 1
                foreign = top in OWNERS and file not in OWNERS[top]
                alone = file.startswith(INDEPENDENT)
                shared = alone and top == "assembly"
                shared = shared and not f"{module}.".startswith("assembly.model.robot.")
                door = file.startswith("assembly/files/")
                unloaded = file.startswith("assembly/") and not door
                unloaded = unloaded and module.startswith(FOR_LOADING)
                typer = top == "typer" and not file.startswith("forcefit/commands/")
                if upward or lost or foreign or shared or unloaded or typer:
                    yield f"{file} imports {module}"


def circle(tree):
    """Names of modules of which each is imported by the one before; none is right."""
    files = {
        ".".join(path.relative_to(tree).with_suffix("").parts): path
        for package in PACKAGES
        for path in sorted((tree / package).rglob("*.py"))
    }
    files = {name.removesuffix(".__init__"): path for name, path in files.items()}
    graph = {
        name: {
            # of "from module import name" one or the other is a file
            one
            for module in imports(path)
            for one in (module, module.rpartition(".")[0])
            if one in files and one != name
        }
        for name, path in files.items()
    }
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return error.args[1]
    return []


def in_memory(code, tree):
    """Modules in memory after a fresh Python ran some code."""
    code = f"{code}\nimport sys; print(*sys.modules, file=sys.stderr)"
    run = [sys.executable, "-c", code]
    answer = subprocess.run(run, cwd=tree, capture_output=True, text=True, check=True)
    return set(answer.stderr.split())


def loaded(modules, tree):
    """Heavy packages in memory after modules were imported in a fresh Python."""
    return sorted(set(HEAVY) & in_memory(f"import {modules}", tree))


def test_every_import_of_the_project_is_allowed():
    assert list(wrong_imports(ROOT)) == []


def test_no_modules_import_one_another_in_a_circle():
    """In folders too: what is below another module can be read without it."""
    assert circle(ROOT) == []


def test_every_folder_was_looked_at():
    """Otherwise a moved folder would pass unseen."""
    standing = {
        chapter(".".join(path.relative_to(ROOT).with_suffix("").parts))[0]
        for package in PACKAGES
        for path in (ROOT / package).rglob("*.py")
    }
    faces = {f"{package}/__init__" for package in PACKAGES} | {"forcefit/__main__"}
    assert standing - faces == set(FLOORS)


@pytest.mark.parametrize("folder", PACKAGES)
def test_every_package_tells_type_checkers_that_it_has_types(folder):
    assert (ROOT / folder / "py.typed").is_file()


@pytest.mark.parametrize("module", PACKAGES)
def test_nothing_heavy_is_imported_before_it_is_needed(module):
    assert loaded(module, ROOT) == []


@pytest.mark.slow
def test_nothing_heavy_is_imported_with_all_files_at_once():
    files = [path for folder in PACKAGES for path in (ROOT / folder).rglob("*.py")]
    names = [".".join(path.relative_to(ROOT).with_suffix("").parts) for path in files]
    modules = sorted(name.removesuffix(".__init__") for name in names)
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
        ("assembly zone irsbot2; assembly error irsbot2; "
         "assembly solve irsbot2 --pose tx=0.1,tz=-0.5", FOR_MANY),
    ],
)  # fmt: skip
def test_a_command_imports_only_what_it_uses(words, left_out):
    """What makes a command wait; benchmarks/startup.py has the times.

    Several in one process: what none of them is to import, none has.
    """
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
    unwanted = {*HEAVY} - {"clarabel"} | {*left_out}
    assert sorted(unwanted & in_memory(code, ROOT)) == []


@pytest.mark.parametrize(
    ("file", "code", "message"),
    [
        ("stiffness/link.py", "import assembly.model.robot", "imports assembly.model"),
        (
            "stiffness/fem/a.py",
            "def f():\n import forcefit.commands.app",
            "imports forcefit.commands.app",
        ),
        (
            "assembly/linear/a.py",
            "from validation.study import x",
            "imports validation.study.x",
        ),
        (
            "assembly/model/a.py",
            "from assembly.linear.zone import x",
            "imports assembly.linear.zone.x",
        ),
        ("assembly/linear/a.py", "import assembly.lost.x", "imports assembly.lost.x"),
        ("assembly/linear/a.py", "import typer", "imports typer"),
        (
            "assembly/linear/a.py",
            "def f():\n from stiffness.fem.fea import solve_link",
            "imports stiffness.fem.fea.solve_link",
        ),
        (
            "assembly/sweeps/a.py",
            "from stiffness.surface.surface import read_surface",
            "imports stiffness.surface.surface.read",
        ),
        ("assembly/model/b.py", "import xarray as xr", "imports xarray"),
        (
            "assembly/linear/zone.py",
            "def f():\n from clarabel import y",
            "imports clar",
        ),
        ("validation/study/a.py", "if x:\n import cvxpy", "imports cvxpy"),
        (
            "validation/multibody/simulation.py",
            "import assembly.linear.energy",
            "imports assembly.lin",
        ),
        (
            "validation/multibody/motion.py",
            "from assembly.linear import zone",
            "imports assembly.linear.z",
        ),
        (
            "validation/multibody/simulation.py",
            "import assembly.files.robot_file",
            "imports assembly.f",
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


@pytest.mark.parametrize(
    "code",
    [
        "from assembly.linear.a import x",
        "import assembly.linear.a",
        "from assembly.linear import a",
        "def f():\n from assembly.linear.a import x",
    ],
)
def test_a_circle_is_found(code, tmp_path):
    """Of two files of one folder, where the floors of folders see nothing."""
    folder = tmp_path / "assembly" / "linear"
    folder.mkdir(parents=True)
    (folder / "a.py").write_text("from assembly.linear.b import y")
    types = "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n "
    (folder / "b.py").write_text(types + "from assembly.linear.a import x")
    assert circle(tmp_path) == []
    (folder / "b.py").write_text(code)
    assert set(circle(tmp_path)) == {"assembly.linear.a", "assembly.linear.b"}


def test_a_heavy_import_is_found(tmp_path):
    (tmp_path / "feather.py").write_text("import json\n")
    (tmp_path / "anvil.py").write_text("import matplotlib\n")
    assert loaded("feather", tmp_path) == []
    assert loaded("anvil", tmp_path) == ["matplotlib"]
