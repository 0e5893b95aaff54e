"""Stiffness of mesh and library links, which is computed when a robot is loaded."""

import builtins
import copy
import io
import logging
import pickle

import numpy as np
import pytest

from forcefit.assembly.effects.robot_effects import apply_robot_effects
from forcefit.assembly.exact.exact import solve_exact
from forcefit.assembly.exchange.robot_files import load_robot
from forcefit.assembly.files.robot_file import read_robot
from forcefit.assembly.files.solved_links import solve_links, solved_link
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.assembly.linear.pose_error import bound_pose_error
from forcefit.assembly.linear.zone import zone_margin
from forcefit.assembly.measurement.conditions import as_declared
from forcefit.assembly.measurement.predict import predict
from forcefit.assembly.model.error_distributions import tolerance_sources
from forcefit.assembly.model.link_stress import peak_stresses
from forcefit.assembly.model.links import link_compliances
from forcefit.assembly.model.robot import MatrixLink, MeshLink
from forcefit.assembly.platform_stiffness.deflection import deflection_curve
from forcefit.assembly.platform_stiffness.platform_stiffness import platform_stiffness
from forcefit.assembly.platform_stiffness.vibration import natural_modes
from forcefit.assembly.statistics.experiment import Experiment
from forcefit.assembly.statistics.monte_carlo import run_draws
from forcefit.assembly.sweeps.identity import robot_hash
from forcefit.assembly.sweeps.plan import Sweep
from forcefit.assembly.sweeps.quantities import Question
from forcefit.assembly.sweeps.sweep import sweep_in_memory
from forcefit.assembly.sweeps.targets import grid_targets, parse_grid
from forcefit.inputs.cache_folder import cache_folder
from forcefit.inputs.table import BadInput
from forcefit.stiffness.link import scaled
from forcefit.stiffness.report.library_build import build_library, read_spec
from forcefit.stiffness.surface.beam_surfaces import shape_surface
from forcefit.validation.crosscheck.crosscheck import crosscheck
from tests.libraries_for_tests import SPEC
from tests.robot_files_for_tests import FOUR_BAR, LINK, PLAY, SPRING

WRIST = 'name = "wrist"\nparent = "rocker"\n'
FILE = (
    FOUR_BAR.replace(LINK, "").replace(SPRING, "")
    .replace(PLAY, """geometric_error = [1e-4, 2e-4, 2e-4, 1e-4, 1e-4, 3e-4]
clearance = { radial = 2e-5, axial = 2e-5, tilt = 1e-5 }
link = { mesh = { surface = "bar.stl", base = "z=0", tip = "z=0.3" }, \
young = 6e10, poisson = 0.3, density = 2700 }""")
    .replace(WRIST, f"""{WRIST}\
link = {{ library = "links#round-beam-length0.3-radius0.01-young6e+10-poisson0.3" }}
""")
)  # fmt: skip
LOAD, GRAVITY = (1, 2, -1, 30, 20, -50), (0, 0, -9.81)


def swept(posture):
    targets = grid_targets(parse_grid("q.crank=0.9:1.1:0.1", posture.robot))
    return sweep_in_memory(
        Sweep(Question(posture.robot, components=targets.names), targets)
    )["energy"]


def drawn(posture):
    sources = tolerance_sources(posture.robot, [1e-4] * 6)
    return run_draws(Experiment(posture, sources), 3)["energy"]


SOLVERS = {
    "zone": lambda at: zone_margin(at).margin,
    "energy": lambda at: solve_assembly(at, LOAD, gravity=GRAVITY).platform_screw,
    "pose error": lambda at: bound_pose_error(solve_assembly(at)).translation_error,
    "exact": lambda at: solve_exact(at, LOAD).platform_screw,
    "platform stiffness": lambda at: platform_stiffness(at).compliance,
    "deflection": lambda at: deflection_curve(at, 5, [10.0, 20.0]).screws,
    "prediction": lambda at: predict(as_declared(at, [LOAD])).deviation,
    "sweep": swept,
    "draws": drawn,
    "crosscheck": lambda at: crosscheck(at, links="spring").slope,
}  # the following functions require more than the stiffness matrix of a link
OF_A_SHAPE = {
    "stress": lambda at: peak_stresses(at.robot, solve_assembly(at).wrenches),
    "frequencies": lambda at: natural_modes(at, 3).frequencies,
}


def refuse(*given, **named):
    """Fail if a solver reads a file or solves a finite-element model."""
    raise AssertionError(
        f"a file was read or a finite-element model solved: {given[:1]}"
    )


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return a folder with a robot file, its mesh and its library."""
    pyvista = pytest.importorskip("pyvista")
    folder = tmp_path_factory.mktemp("robot")
    bar = shape_surface("rectangle", {"length": 0.3, "width": 0.02, "height": 0.02})
    pyvista.PolyData.from_regular_faces(bar.points, bar.triangles).save(
        folder / "bar.stl"
    )
    (folder / "spec.toml").write_text(SPEC)
    build_library(read_spec(folder / "spec.toml"))
    (folder / "robot.toml").write_text(FILE)
    return folder


@pytest.fixture
def robot(folder):
    return load_robot(folder / "robot.toml")


@pytest.fixture
def sealed(monkeypatch, folder):
    """Return a function that disables file access and finite-element solutions."""
    ours = str(folder), str(cache_folder())
    usual = io.open

    def checked_open(file, *given, **named):
        opening = refuse if str(file).startswith(ours) else usual
        return opening(file, *given, **named)

    def seal():
        for module in (builtins, io):
            monkeypatch.setattr(module, "open", checked_open)
        monkeypatch.setattr("forcefit.stiffness.fem.fea.solve_link", refuse)
        for module in ("condensation", "own_weight"):
            monkeypatch.setattr(f"forcefit.stiffness.fem.{module}.solve", refuse)

    return seal


@pytest.mark.parametrize("solver", SOLVERS)
def test_solvers_require_only_stiffness_matrices_of_links(folder, solver, sealed):
    """The result is equal if the links are replaced by their stiffness matrices."""
    robot = load_robot(folder / "robot.toml")
    names = [frame.name for frame in robot.frames]
    matrices = dict(zip(names, link_compliances(robot), strict=True))
    twin = robot.with_links({
        name: MatrixLink(np.linalg.inv(C)) for name, C in matrices.items() if C.any()
    })  # fmt: skip
    # this call also imports and compiles all functions
    expected = SOLVERS[solver](home_posture(twin))
    again = load_robot(folder / "robot.toml")  # a robot without cached results
    sealed()
    found = SOLVERS[solver](home_posture(again))
    scale = np.abs(np.asarray(expected)).max()
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-6 * scale)


@pytest.mark.parametrize("solver", OF_A_SHAPE)
def test_stresses_and_frequencies_do_not_require_link_files(folder, solver, sealed):
    first, again = (load_robot(folder / "robot.toml") for _ in range(2))
    expected = OF_A_SHAPE[solver](home_posture(first))
    sealed()
    found = OF_A_SHAPE[solver](home_posture(again))
    np.testing.assert_array_equal(found, expected)


def test_compliance_of_mesh_link_is_inverse_to_modulus_scale(folder, robot, sealed):
    """The compliance agrees with a finite-element solution for the scaled modulus."""
    (folder / "half.toml").write_text(FILE.replace("6e10", "3e10", 1))
    expected = link_compliances(load_robot(folder / "half.toml"))
    effect = '[[effect]]\nname = "modulus_scale"\nparameters = { elbow = 0.5 }\n'
    (folder / "soft.toml").write_text(FILE + effect)
    declared = home_posture(load_robot(folder / "soft.toml"))
    sealed()
    found = apply_robot_effects(declared).posture.robot
    row = robot.index("elbow")
    soft = link_compliances(found)[row]
    np.testing.assert_array_equal(soft, 2 * link_compliances(robot)[row])
    assert np.abs(scaled(soft - expected[row], soft)).max() < 1e-7


def test_solvers_reject_links_without_stiffness(folder):
    robot = read_robot(folder / "robot.toml")
    for name, kind in (("elbow", "mesh"), ("wrist", "library")):
        message = rf'^frame "{name}"\.link\.{kind}: found no stiffness'
        with pytest.raises(BadInput, match=message):
            solve_assembly(home_posture(robot))
        solved = {name: solved_link(robot.frame(name))}
        robot = robot.with_links(solved)
    assert solve_assembly(home_posture(robot)).energy > 0


def test_loading_without_links_does_not_require_link_files(folder):
    (folder / "missing.toml").write_text(FILE.replace("bar.stl", "none.stl"))
    robot = load_robot(folder / "missing.toml", links=False)
    assert zone_margin(home_posture(robot)).margin > 0


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("bar.stl", "none.stl", r'"elbow"\.link\.mesh: .*none.stl.* cannot be read'),
        ("z=0.3", "z=0.4", r'"elbow"\.link\.mesh: .*no face .* on the tip interface'),
        ("length0.3", "length0.4", r'"wrist"\.link\.library: .*no entry'),
        ('"elbow"\nparent = "crank"\ntranslation = [0.3, 0, 0]',
         '"elbow"\nparent = "crank"\ntranslation = [0.31, 0, 0]',
         r'"elbow"\.link\.mesh: the centre of the mesh.s tip interface'),
    ],
)  # fmt: skip
def test_invalid_link_file_is_rejected_before_finite_elements(
    folder, old, new, message, monkeypatch
):
    """The message consists of one line."""
    monkeypatch.setattr("forcefit.stiffness.fem.fea.solve_link", refuse)
    monkeypatch.setattr("forcefit.assembly.files.solved_links._SOLVED", {})
    path = folder / "refused.toml"
    path.write_text(FILE.partition("[[closure]]")[0].replace(old, new))
    with pytest.raises(BadInput, match=rf"refused\.toml: frame {message}") as refused:
        load_robot(path)
    assert "\n" not in str(refused.value)


def test_equal_mesh_links_are_solved_once(folder, caplog, tmp_path, monkeypatch):
    monkeypatch.setenv("FORCEFIT_CACHE", str(tmp_path))
    monkeypatch.setattr("forcefit.assembly.files.solved_links._SOLVED", {})
    link = 'link = { mesh = { surface = "bar.stl", base = "z=0", tip = "z=0.3" }, '
    link += "young = 7e10, poisson = 0.3, density = 2700 }"
    both = "\n".join(
        link if line.startswith("link = {") else line for line in FILE.splitlines()
    )
    (folder / "both.toml").write_text(both)
    with caplog.at_level(logging.INFO, "forcefit.links"):
        robot = load_robot(folder / "both.toml")
    surface = folder / "bar.stl"
    logged = [r.message for r in caplog.records if r.name == "forcefit.links"]
    assert logged == [f'finite elements of frame "elbow", {surface}']
    first, second = (f.link for f in robot.frames if isinstance(f.link, MeshLink))
    assert first.solution is second.solution


def test_robot_hash_depends_on_content_of_step_file(folder, monkeypatch):
    """The path of the surface is followed by the name of a solid."""
    bar = shape_surface("rectangle", {"length": 0.3, "width": 0.02, "height": 0.02})
    monkeypatch.setattr(
        "forcefit.stiffness.surface.surface.read_surface", lambda *given: bar
    )
    (folder / "step.toml").write_text(FILE.replace("bar.stl", "bar.step#*"))
    digests = set()
    for content in ("one", "other"):
        (folder / "bar.step").write_text(content)
        digests.add(robot_hash(load_robot(folder / "step.toml")))
    assert len(digests) == 2


def test_pickled_robot_does_not_contain_meshes(robot):
    sent = pickle.dumps(robot)
    assert len(sent) < 20_000
    there = solve_links(pickle.loads(sent))
    np.testing.assert_array_equal(link_compliances(there), link_compliances(robot))
    assert solve_links(robot) is robot
    copied = copy.deepcopy(robot)
    np.testing.assert_array_equal(link_compliances(copied), link_compliances(robot))
