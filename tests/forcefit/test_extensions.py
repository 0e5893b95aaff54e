"""Readers, effects and link models that other distributions provide."""

import json
import re
import shutil
import subprocess
import sys
import tomllib
from math import pi

import numpy as np
import pytest

import forcefit as ff
from forcefit.inputs.errors import BadInput
from tests.test_tutorials import ROOT

EXAMPLE = ROOT / "examples/extension"
R, r, L, E, NU = 0.045, 0.025, 0.35, 7e10, 0.33
SIZES = f"start_radius = {R}, end_radius = {r}, young = {E}, poisson = {NU}"
LINK = f'link = {{ model = {{ name = "cone", {SIZES} }} }}'
CONE = f"""
name = "one_arm"
platform = "tip"
[[frame]]
name = "tip"
parent = "base"
rotation = [0.0, 0.0, 1.5707963267948966]
translation = [0.0, {L}, 0.0]
{LINK}
"""
ARM = """
name = "arm"
platform = "tip"
[[frame]]
name = "joint1"
parent = "base"
joint = "revolute"
actuated = true
position = 0.5
[[frame]]
name = "tip"
parent = "joint1"
translation = [0.8, 0.0, 0.0]
[[effect]]
name = "drive_gain"
parameters = { joint1 = 1e-3 }
"""


BROKEN = """
from forcefit.assembly.effects.effect import Effect

def fails(span, values):
    return values["absent"]

def small(span, values):
    return [1.0]

def ragged(span, values):
    return [[1.0], [1.0, 2.0]]

def loose(span, values):
    return [[0.0] * 6] * 6

def read(path):
    return int("three")

def count(path):
    return 3

def apply(conditions, values):
    return conditions.nothing

FAILS, OTHER = (
    Effect(name, apply, lambda robot, name: "1", None, ("",), lambda robot: ())
    for name in ("failing", "another")
)
"""


def install(folder, name, groups):
    """Write the metadata of an installed distribution with entry points."""
    info = folder / f"{name}-0.1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Name: {name}\nVersion: 0.1.0\n")
    lines = []
    for group, points in groups.items():
        lines += [f"[{group}]", *(f"{key} = {value}" for key, value in points.items())]
    (info / "entry_points.txt").write_text("\n".join(lines) + "\n")


@pytest.fixture
def packages(tmp_path, monkeypatch):
    """Return a folder on the import path in which distributions are installed."""
    folder = tmp_path / "packages"
    folder.mkdir()
    monkeypatch.syspath_prepend(folder)
    yield folder
    for name in ("forcefit_extension", "broken"):
        sys.modules.pop(name, None)


@pytest.fixture
def example(packages):
    """Install the example distribution."""
    project = tomllib.loads((EXAMPLE / "pyproject.toml").read_text())["project"]
    shutil.copy(EXAMPLE / "forcefit_extension.py", packages)
    install(packages, project["name"], project["entry-points"])


@pytest.fixture
def broken(packages):
    """Install a distribution with entry points that fail."""
    (packages / "broken.py").write_text(BROKEN)
    (packages / "raises.py").write_text("1 / 0\n")
    install(packages, "their-tools", {
        "forcefit.effects": {"drive_gain": "broken:fails", "raising": "raises:GAIN",
                             "gone": "no_such_module:GAIN",
                             "failing": "broken:FAILS", "misnamed": "broken:OTHER"},
        "forcefit.readers": {"three": "broken:read", "count": "broken:count",
                             "absent": "broken:absent", "gone": "no_such_module:read"},
        "forcefit.link_models": {"fails": "broken:fails", "small": "broken:small",
                                 "loose": "broken:loose", "ragged": "broken:ragged",
                                 "cone": "broken:absent"},
    })  # fmt: skip


def written(tmp_path, text):
    path = tmp_path / "robot.toml"
    path.write_text(text)
    return path


def test_cone_link_model_agrees_with_handbook_formulas(example, tmp_path):
    """The deflections are F L^3/(3 E I) R/r in bending and F L/(E pi R r) in tension.

    I is the second moment of area at the base.
    """
    robot = ff.load_robot(written(tmp_path, CONE))
    C = ff.platform_stiffness(ff.place_robot(robot)).compliance
    second, G = pi * R**4 / 4, E / (2 * (1 + NU))
    bending = L**3 / (3 * E * second) * R / r
    axial = L / (E * pi * R * r)
    q = R / r
    torsion = L / (2 * G * second) * (q + q**2 + q**3) / 3
    # the cone is parallel to the y axis of the base
    assert np.diag(C)[3:] == pytest.approx([bending, axial, bending], rel=1e-9)
    assert C[1, 1] == pytest.approx(torsion, rel=1e-9)


def test_written_robot_contains_stiffness_instead_of_model(example, tmp_path):
    robot = ff.load_robot(written(tmp_path, CONE))
    ff.write_robot(robot, tmp_path / "again.toml")
    assert "model" not in (tmp_path / "again.toml").read_text()
    assert ff.load_robot(tmp_path / "again.toml") == robot


def test_sweep_can_vary_a_link_model_parameter(example, tmp_path):
    """The bending compliance is proportional to 1/(R^3 r)."""
    path = written(tmp_path, CONE)
    data = ff.sweep(path, vary=["tip.link.model.end_radius=0.025,0.05"],
                    quantities=["compliance"], state="nominal",
                    poses=_home(tmp_path))  # fmt: skip
    bending = data["compliance"].sel(screw="TX", wrench_component="FX").values.ravel()
    assert bending[1] / bending[0] == pytest.approx(0.5, rel=1e-9)


def _home(tmp_path):
    path = tmp_path / "poses.csv"
    path.write_text(f"ty\n{L}\n")
    return path


def test_link_model_has_equal_compliance_in_format_2(example, tmp_path):
    """The cone in a file of format 2 has the same compliance as with frames."""
    drawn = f"""
format = 2
name = "drawn"
platform = "arm"
platform_at = [0, {L}, 0]
[[body]]
name = "arm"
{LINK}
[[joint]]
name = "pin"
type = "fixed"
between = ["base", "arm"]
at = [0, 0, 0]
"""
    found, frames = (
        ff.platform_stiffness(ff.place_robot(ff.load_robot(written(tmp_path, text))))
        for text in (drawn, CONE)
    )
    np.testing.assert_allclose(
        found.compliance, frames.compliance, rtol=1e-9, atol=1e-16
    )


def test_drive_gain_effect_rotates_the_arm(example, tmp_path, run):
    """A gain error of 1e-3 at 0.5 rad rotates the 0.8 m arm by 0.5 mrad."""
    path = written(tmp_path, ARM)
    code, _, err = run("assembly", "solve", path, "--json", tmp_path / "o.json")
    assert (code, err) == (0, "")
    screw = json.loads((tmp_path / "o.json").read_text())["platform_screw"]
    across = 0.4e-3 * np.array([-np.sin(0.5), np.cos(0.5)])
    assert screw[2] == pytest.approx(5e-4)
    assert screw[3:5] == pytest.approx(across)
    robot = ff.load_robot(path)
    ff.write_robot(robot, tmp_path / "again.toml")
    assert ff.load_robot(tmp_path / "again.toml") == robot


def test_message_names_unknown_effect_parameter(example, tmp_path):
    path = written(tmp_path, ARM.replace("joint1 = 1e-3", "joint2 = 1e-3"))
    with pytest.raises(
        BadInput, match='found "joint2", which is not a parameter of drive_g'
    ):
        ff.load_robot(path)


def test_diagnosis_identifies_an_installed_effect(example, tmp_path):
    """The first drive moves by 1.002 times its command.

    The readings are computed with x = a cos q1 + b cos(q1 + q2).
    """
    names, rng = ("one", "two"), np.random.default_rng(2)
    frames = [
        ff.Frame("one", joint="revolute", actuated=True),
        ff.Frame("two", "one", translation=[1, 0, 0], joint="revolute", actuated=True),
        ff.Frame("tool", "two", translation=[0.8, 0, 0]),
    ]
    folder = tmp_path / "campaign"
    folder.mkdir()
    ff.write_robot(ff.Robot("arm", "tool", tuple(frames)), folder / "robot.toml")
    (folder / "campaign.toml").write_text(
        'robot = "robot.toml"\nmeasurements = "m.csv"\nregistration = "known"\n'
        "reference_point = [0.0, 0.0, 0.0]\n[noise]\nrotation = 1e-5\nposition = 1e-5\n"
    )

    def tool(q):
        angles = np.cumsum(q, axis=1)
        return np.stack([angles[:, 1], np.cos(angles) @ [1, 0.8],
                         np.sin(angles) @ [1, 0.8]], axis=1)  # fmt: skip

    q = rng.uniform(-2.5, 2.5, (70, 2))
    meas = tool(q * [1.002, 1.0]) - tool(q) + 1e-5 * rng.normal(size=(70, 3))
    rows = [",".join(["id", *(f"q.{n}" for n in names), "meas.rz,meas.tx,meas.ty"])]
    rows += [
        f"r{i}," + ",".join(f"{v:.9g}" for v in [*q[i], *meas[i]]) for i in range(70)
    ]
    (folder / "m.csv").write_text("\n".join(rows) + "\n")
    found = ff.diagnose(ff.read_campaign(folder), odds={"function": 0.0})
    assert found.claimed == ("drive_gain",)
    assert found.robot.effects["drive_gain"]["one"] == pytest.approx(2e-3, rel=0.02)


BROKEN_PARTS = [
    ("raising", "the effect raises:GAIN of their-tools cannot be imported: ZeroDiv"),
    ("gone", "the effect no_such_module:GAIN of their-tools cannot be imported: No"),
    ("drive_gain", "the effect broken:fails of their-tools: found function, expected"),
    ("failing", "the effect broken:FAILS of their-tools failed: Attrib"),
    ("cone", "model broken:absent of their-tools cannot be imported: "),
    ("fails", "model broken:fails of their-tools failed: KeyError: 'absent'"),
    ("small", "model broken:small of their-tools returned an array of shape "),
    ("loose", "model broken:loose of their-tools: stiffness is not positive"),
    ("ragged", "model broken:ragged of their-tools did not return an array of "),
    ("cine", 'found "cine", expected an installed link model; did you mean'),
    ("arm.three", "the reader broken:read of their-tools failed: ValueEr"),
    ("arm.count", "of their-tools returned int, expected a Robot"),
    ("arm.absent", "of their-tools cannot be imported: "),
    ("arm.gone", "of their-tools cannot be imported: No module named"),
]


@pytest.mark.parametrize(("name", "message"), BROKEN_PARTS)
def test_message_about_a_broken_extension_names_its_distribution(
    name, message, broken, tmp_path, run
):
    path, place = tmp_path / name, ""
    if "the effect" in message:
        values = "{ }" if name == "failing" else "{ joint1 = 1e-3 }"
        text = ARM.replace("drive_gain", name).replace("{ joint1 = 1e-3 }", values)
        path = written(tmp_path, text)
        place = "" if name == "failing" else f'{path}: effect "{name}"'
    elif "model" in message:
        path = written(tmp_path, CONE.replace('"cone"', f'"{name}"'))
        place = f'{path}: frame "tip".link.model'
    else:
        path.write_text("3")
    code, out, err = run("assembly", "solve", path)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert message in err
    assert place in err


def test_broken_effect_does_not_affect_other_robots(broken, tmp_path):
    text = ARM.replace("drive_gain", "encoder_offset")
    robot = ff.load_robot(written(tmp_path, text))
    assert robot.effects == {"encoder_offset": {"joint1": 1e-3}}


def test_effect_in_two_distributions_is_rejected(example, packages, tmp_path):
    points = {"forcefit.effects": {"drive_gain": "forcefit_extension:DRIVE_GAIN"}}
    install(packages, "another", points)
    with pytest.raises(BadInput, match="drive_gain in another and forcefit-extension"):
        ff.load_robot(written(tmp_path, ARM))


def test_extension_cannot_replace_forcefit_effects(example, packages, tmp_path):
    points = {"forcefit.effects": {"encoder_offset": "forcefit_extension:DRIVE_GAIN"}}
    install(packages, "another", points)
    robot = ff.load_robot(
        written(tmp_path, ARM.replace("drive_gain", "encoder_offset"))
    )
    screw = ff.sweep(robot, grid="q.joint1=0.5").squeeze()["platform_screw"]
    # the offset, not the gain times 0.5 rad
    assert float(screw.sel(screw="RZ")) == pytest.approx(1e-3)


def test_installed_reader_is_used_by_commands_and_functions(example, run, tmp_path):
    """The links are aligned with x, so that the tip is at the sum of their lengths."""
    path = tmp_path / "arm.CHAIN"
    path.write_text("0.3 0.2 0.15")
    assert ff.place_robot(ff.load_robot(path)).pose()["tx"] == pytest.approx(0.65)
    status, out, err = run("assembly", "solve", path, "--json", "-")
    assert (status, err) == (0, "")
    assert json.loads(out)["pose"]["tx"] == pytest.approx(0.65)
    swept = ff.sweep(path, grid="q.joint1=0:0.2:0.1", quantities=["energy"],
                     vary=["joint2.translation.x=0.1,0.2"])  # fmt: skip
    assert np.all(swept.energy.values == 0.0)
    path.write_text("")
    with pytest.raises(BadInput, match="found no lengths"):
        ff.load_robot(path)


def test_two_readers_for_one_file_extension_are_rejected(example, packages, tmp_path):
    install(packages, "another", {"forcefit.readers": {"chain": "broken:read"}})
    (tmp_path / "arm.chain").write_text("1")
    with pytest.raises(
        BadInput, match=r"reader chain in another and forcefit-extension"
    ):
        ff.load_robot(tmp_path / "arm.chain")


def test_extension_cannot_replace_forcefit_readers(example, packages, tmp_path):
    readers = dict.fromkeys(("toml", "urdf"), "forcefit_extension:read_chain")
    install(packages, "another", {"forcefit.readers": readers})
    for name in ("arm.toml", "arm.urdf"):
        ff.write_robot(ff.load_robot("arm6"), tmp_path / name)
        assert len(ff.load_robot(tmp_path / name).frames) > 5


def test_documented_extension_equals_the_example():
    page = (ROOT / "docs/extensions.md").read_text(encoding="utf-8")
    source = (EXAMPLE / "forcefit_extension.py").read_text(encoding="utf-8")
    project = (EXAMPLE / "pyproject.toml").read_text(encoding="utf-8")
    shown = re.findall(r"```text\n(def .*?|DRIVE_GAIN.*?|\[project.*?)```", page, re.S)
    assert len(shown) == 3
    for block in shown:
        assert block in source or block in project, block


@pytest.mark.slow
def test_new_process_finds_the_installed_extension(example, packages, tmp_path):
    """A new Python process finds the entry points."""
    path = written(tmp_path, CONE)
    command = "import forcefit as ff, sys; print(ff.load_robot(sys.argv[1]).name)"
    found = subprocess.run(
        [sys.executable, "-c", command, str(path)], capture_output=True, text=True,
        env={"PYTHONPATH": f"{packages}:{ROOT}", "PATH": "/usr/bin:/bin"}, check=False,
    )  # fmt: skip
    assert (found.returncode, found.stdout.strip()) == (0, "one_arm"), found.stderr
