"""Optional packages, minimal installation, and modules with equal names."""

import json
import os
import re
import shutil
import subprocess
import sys
import tomllib

import numpy as np
import pytest

import forcefit as ff
from forcefit.inputs.errors import BadInput
from forcefit.inputs.packages import naming_packages
from tests.packages_for_tests import ROOT, modules_of, run_without

LEAST = ("numpy", "scipy", "clarabel", "typer", "rich")
FOLDERS = ("assembly", "stiffness", "validation")
POSE = ("--pose", "tx=0.1,tz=-0.5")
GRID = ("--grid", "tx=-0.1:0.1:0.1,tz=-0.5")
MSH = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n"
LOOPS = "closed_loop: []\n"
URDF = '<robot name="r"><link name="base"/></robot>\n'


@pytest.fixture
def files(tmp_path):
    """Return files that require a package; the missing package is reported first."""
    texts = {
        "a.msh": MSH,
        "a.step": "ISO-10303-21;\n",
        "a.yaml": LOOPS,
        "a.urdf": URDF,
        "a.nc": "",
    }
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
    return tmp_path


@pytest.mark.parametrize(
    ("hidden", "distribution", "cure", "words"),
    [
        ("xarray", "xarray", "forcefit[sweeps]",
         ("assembly", "sweep", "irsbot2", *GRID, "-o", "b.nc")),
        ("h5py", "h5py", "forcefit[sweeps]",
         ("assembly", "tolerances", "irsbot2", *GRID, "--plan",
          ROOT / "examples/tolerance_allocation/mostly.toml", "-o", "b.nc")),
        ("distributed", "distributed", "forcefit[sweeps]",
         ("assembly", "sweep", "irsbot2", *GRID, "-o", "b.nc", "--workers", "2")),
        ("xarray", "xarray", "forcefit[sweeps]",
         ("assembly", "statistics", "irsbot2", *POSE, "--draws", "10", "--errors",
          ROOT / "examples/irsbot2_errors.toml")),
        ("xarray", "xarray", "forcefit[sweeps]",
         ("assembly", "plot", "a.nc", "--csv", "b.csv")),
        ("matplotlib", "matplotlib", "forcefit[report]",
         ("assembly", "plot", "a.nc", "--figure", "b.png")),
        ("h5netcdf", "h5netcdf", "forcefit[sweeps]",
         ("study", ROOT / "examples/irsbot2.toml", "-o", "b")),
        ("exudyn", "exudyn", "exudyn",
         ("study", ROOT / "examples/irsbot2.toml", "-o", "b")),
        ("jinja2", "jinja2", "jinja2",
         ("study", ROOT / "examples/irsbot2.toml", "-o", "b")),
        ("pyvista", "pyvista", "pyvista",
         ("assembly", "show", "irsbot2", *POSE, "--figure", "b.png")),
        ("exudyn", "exudyn", "exudyn",
         ("validation", "crosscheck", "irsbot2", *POSE, "--errors",
          ROOT / "examples/irsbot2_errors.toml")),
    ],
)  # fmt: skip
def test_command_names_the_package_to_install(files, hidden, distribution, cure, words):
    """The command writes no files."""
    before = sorted(files.iterdir())
    status, out, err = run_without(files, hidden, *words)
    said = err.strip().splitlines()[-1]
    assert said == (
        f"forcefit: this command needs the package {distribution}; install {cure}"
    )
    assert (status, out) == (2, "")
    written = {path.name for path in set(files.iterdir()) - set(before)}
    assert written <= {"sitecustomize.py", "__pycache__"}


FEA = ("--base", "z=0", "--tip", "z=1", "--young", "1e9", "--poisson", "0.3")


@pytest.mark.parametrize(
    ("hidden", "said", "words"),
    [
        ("meshio", "a.msh: MSH needs the package meshio; install forcefit[msh]",
         ("stiffness", "fea", "a.msh", *FEA)),
        ("gmsh", "a.step: STEP needs the package gmsh; install forcefit[gmsh], or "
         "export the surface as STL", ("stiffness", "fea", "a.step", *FEA)),
        ("yaml", "a.yaml: YAML needs the package pyyaml; install forcefit[yaml]",
         ("convert", "a.urdf", "--loops", "a.yaml", "-o", "b.toml")),
    ],
)  # fmt: skip
def test_reader_names_the_package_to_install(files, hidden, said, words):
    status, out, err = run_without(files, hidden, *words)
    assert err.strip().splitlines()[-1] == f"forcefit: {said}"
    assert (status, out) == (2, "")


def test_conversion_without_mujoco_reports_no_comparison(tmp_path):
    """MuJoCo is only required to check the conversion."""
    status, out, err = run_without(tmp_path, "mujoco", "convert", "arm6", "-o", "b.xml")
    assert (status, err) == (0, "")
    assert "b.xml was not compared with another program: MuJoCo is not installed" in out
    assert (tmp_path / "b.xml").is_file()


@pytest.mark.slow
def test_finite_elements_without_mkl_have_equal_results(tmp_path):
    """Without MKL, the factorisation of SciPy is used."""
    surface = ROOT / "meshes/distal_plain.stl"
    held = ("--base", "z=0", "--tip", "z=0.452", *FEA[4:], "--accuracy", "0.05")
    found = []
    for hidden in ("", "pypardiso"):
        words = ("stiffness", "fea", surface, *held, "--json", "-")
        status, out, err = run_without(tmp_path, hidden, *words)
        assert status == 0, err
        found.append(json.loads(out))
    assert found[1]["mesh"]["solver"] == "SuperLU"
    one, other = (np.array(each["stiffness"]) for each in found)
    scale = np.sqrt(np.outer(one.diagonal(), one.diagonal()))
    assert np.abs((other - one) / scale).max() < 1e-9


def test_missing_forcefit_module_is_raised_unchanged():
    """Such an error is a defect of forcefit, which an installation cannot solve."""
    with pytest.raises(ModuleNotFoundError), naming_packages():
        raise ModuleNotFoundError("No module named 'forcefit.x'", name="forcefit.x")


def test_message_names_the_extra_of_a_missing_package():
    """The extras are read from pyproject.toml."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    for extra in set(extras) - {"all", "dev", "docs", "examples", "benchmarks"}:
        for line in extras[extra]:
            package = re.split(r"[<>=; ]", line)[0]
            module = {"pyyaml": "yaml"}.get(package, package)
            with pytest.raises(
                BadInput, match=rf"{package}; install forcefit\[{extra}\]"
            ):
                with naming_packages():
                    raise ModuleNotFoundError(name=module)
        # MKL is large and proprietary and therefore not part of [all]
        listed = re.search(rf"[\[,]{extra}[\],]", extras["all"][0])
        assert bool(listed) == (extra != "mkl")


@pytest.mark.parametrize("words", [
    ("assembly", "solve", "robot.toml", *POSE, "--json", "{}.json"),
    ("assembly", "error", "robot.toml", *POSE),
    ("stiffness", "beam", "--length", "1", "--radius", "0.1", *FEA[4:]),
])  # fmt: skip
def test_solving_one_posture_requires_five_packages(tmp_path, words):
    """Results are equal if all packages except LEAST are hidden."""
    ff.write_robot(ff.load_robot("irsbot2"), tmp_path / "robot.toml")
    shown = modules_of(*LEAST) | {"forcefit"}
    assert not {"xarray", "cvxpy", "pyvista", "exudyn", "threadpoolctl"} & shown
    answers = [
        run_without(
            tmp_path, "", *(word.format(len(each)) for word in words), shown=each
        )
        for each in ((), shown)
    ]
    assert answers[0] == answers[1]
    assert answers[0][0] == 0


def ran(folders, code):
    """Return exit status, standard output and standard error of a new Python."""
    path = os.pathsep.join(map(str, folders))
    done = subprocess.run(
        [sys.executable, "-P", "-c", code], env=os.environ | {"PYTHONPATH": path},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    return done.returncode, done.stdout.strip(), done.stderr.strip()


@pytest.mark.parametrize("name", FOLDERS)
@pytest.mark.parametrize("file", ["{}.py", "{}/__init__.py"])
@pytest.mark.parametrize("first", ["forcefit", "json"])
def test_user_module_and_forcefit_package_do_not_conflict(tmp_path, name, file, first):
    other = tmp_path / file.format(name)
    other.parent.mkdir(exist_ok=True)
    other.write_text("owner = 'another program'\n")
    code = f"import {first}, {name}, forcefit.{name} as ours; print({name}.owner, ours)"
    status, out, err = ran([tmp_path, ROOT], code)
    assert (status, err) == (0, "")
    assert out.startswith(f"another program <module 'forcefit.{name}' from")


@pytest.mark.parametrize("name", FOLDERS)
@pytest.mark.parametrize("first", ["forcefit", "json"])
def test_old_package_name_imports_the_new_module(name, first):
    """In a checkout, Python finds the folder with the old name first."""
    module = {"stiffness": "link", "assembly": "model.robot", "validation": "study"}
    old = f"{name}.{module[name]}"
    code = f"import {first}, sys, {old}; print({old} is sys.modules['forcefit.{old}'])"
    status, out, err = ran([ROOT], code)
    assert (status, out) == (0, "True")
    warning = f"FutureWarning: the package {name} is now forcefit.{name}"
    assert err.splitlines()[0].endswith(warning)


def test_new_names_cause_no_warning():
    assert ran([ROOT], "import forcefit.validation.study.study") == (0, "", "")


def test_checkout_without_symbolic_links_finds_the_packages(tmp_path):
    """On Windows, git writes symbolic links as text files."""
    links = shutil.ignore_patterns("assembly", "stiffness", "validation")
    shutil.copytree(ROOT / "forcefit", tmp_path / "forcefit", ignore=links)
    (tmp_path / "forcefit" / "stiffness").write_text("../stiffness")
    for name in FOLDERS:
        (tmp_path / name).symlink_to(ROOT / name)
    code = "import forcefit.stiffness.link as link; print(link.__name__)"
    assert ran([tmp_path], code) == (0, "forcefit.stiffness.link", "")
