"""Figures and interactive scenes of robots and results."""

import html
import re
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib import pyplot
from mpl_toolkits.mplot3d.art3d import Line3D, Poly3DCollection

import forcefit as ff
from forcefit import BadInput, BeamLink, Frame, MatrixLink, Robot, solve_assembly
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.platform_stiffness.platform_stiffness import platform_stiffness
from forcefit.assembly.report.error_body import ErrorBody
from forcefit.assembly.report.scene import robot_scene
from tests.forcefit.page.test_browser import browser, wait
from tests.pages_for_tests import parse

FORCE, LENGTH = 50.0, 0.4
STIFFNESS = 2e11 * np.pi * 0.01**4 / 4  # [N m^2] bending stiffness


@pytest.fixture(autouse=True)
def _windows_are_closed():
    yield
    pyplot.close("all")


def cantilever():
    """Return a round bar along x, clamped at its base."""
    beam = BeamLink({"radius": 0.01}, 2e11, 0.3, theory="euler")
    tip = Frame("tip <b>", translation=[LENGTH, 0, 0], link=beam)
    return home_posture(Robot("bar <i>", "tip <b>", (tip,)))


def bent(force=FORCE):
    return solve_assembly(cantilever(), [0, 0, 0, 0, 0, -force])


def lines_of(figure):
    """Return the points of each line by its legend entry."""
    lines = [line for line in figure.axes[0].lines if isinstance(line, Line3D)]
    return {line.get_label(): np.column_stack(line.get_data_3d()) for line in lines}


def test_figure_of_a_loaded_bar_has_the_deflection_of_a_cantilever():
    """The deflection F L^3 / (3 E I) is magnified by the factor in the title."""
    figure = bent().plot(interactive=False)
    lines = lines_of(figure)
    title = figure.axes[0].get_title()
    assert title.startswith("bar <i>")
    factor = float(title.rpartition("x ")[2])
    tip = -FORCE * LENGTH**3 / (3 * STIFFNESS)
    expected = [1e3 * LENGTH, 0, 1e3 * factor * tip]
    assert lines["forced, elastic"][-2] == pytest.approx(expected)
    assert lines["nominal"][-2] == pytest.approx([1e3 * LENGTH, 0, 0])
    assert figure.axes[0].get_zlabel() == "z [mm]"


def test_large_rotation_is_drawn_to_scale():
    """For a rigid bar on a torsion spring, the angle a satisfies k a = F L cos a.

    For k = 10 N m/rad and F L = 20 N m, the angle is 1.0298665 rad.
    """
    hinge = Frame("hinge", joint_stiffness=[np.inf, np.inf, 10.0, *[np.inf] * 3])
    tip = Frame("tip", "hinge", translation=[LENGTH, 0, 0])
    posture = home_posture(Robot("bar", "tip", (hinge, tip)))
    found = ff.solve_exact(posture, load={"fy": 20.0 / LENGTH})
    angle = 1.0298665
    assert 10 * angle == pytest.approx(20 * np.cos(angle), rel=1e-7)
    figure = found.plot(interactive=False)
    assert figure.axes[0].get_title() == "bar, displacements x 1"
    end = lines_of(figure)["forced, rigid"]
    end = end[np.isfinite(end).all(axis=1)][-1]
    place = 1e3 * LENGTH * np.array([np.cos(angle), np.sin(angle), 0])
    np.testing.assert_allclose(end, place, atol=1e-3)
    assert figure.axes[0].get_ylim()[1] > place[1]


def test_figure_of_a_robot_shows_its_home_pose():
    """The robot has a crank of 0.3 m at 90 degrees and a collinear bar of 0.2 m."""
    drive = Frame("drive", joint="revolute", actuated=True, position=np.pi / 2)
    elbow = Frame("elbow", "drive", translation=[0.3, 0, 0])
    tip = Frame("tip", "elbow", translation=[0.2, 0, 0])
    figure = Robot("arm", "tip", (drive, elbow, tip)).show()
    drawn = lines_of(figure)["nominal, rigid"]
    expected = [[0, 0, 0], [0, 300, 0], [0, 300, 0], [0, 500, 0]]
    ends = drawn[np.isfinite(drawn).all(axis=1)].reshape(2, -1, 3)[:, [0, -1]]
    np.testing.assert_allclose(ends.reshape(4, 3), expected, atol=1e-10)


def test_bar_chart_is_proportional_to_compliance():
    """Of two springs k and 2 k in series, the first contributes two thirds of the
    compliance.
    """
    K = np.diag([1e3] * 3 + [1e5] * 3)
    frames = (Frame("a", link=MatrixLink(K)), Frame("b", "a", link=MatrixLink(2 * K)))
    K_C = platform_stiffness(home_posture(Robot("two", "b", frames)))
    (axes,) = K_C.plot().axes
    heights = {c.get_label(): [bar.get_height() for bar in c] for c in axes.containers}
    np.testing.assert_allclose(heights["a link"], 200 / 3)
    np.testing.assert_allclose(heights["b link"], 100 / 3)
    (spec,) = parse(K_C.plot(interactive=True).html).figures
    assert spec["traces"][0]["y"] == pytest.approx([2 / 3] * 6)


def slack():
    """Return a bar with a joint clearance of 0.2 mm."""
    joint = Frame("joint", clearance=ff.Clearance(radial=2e-4, axial=1e-4))
    tip = Frame("tip", "joint", translation=[LENGTH, 0, 0])
    return solve_assembly(home_posture(Robot("slack", "tip", (joint, tip))))


def test_platform_errors_are_drawn_in_figures_and_scenes():
    figure = slack().plot(errors="translation", assumption="frozen")
    assert any(isinstance(c, Poly3DCollection) for c in figure.axes[0].collections)
    page = slack().plot(errors="translation", interactive=True)
    (spec,) = parse(page.html).figures
    largest = np.linalg.norm(spec["body"]["points"], axis=1).max()
    # The largest error is at the edge of a cylinder.
    assert largest == pytest.approx(np.hypot(2e-4, 1e-4), rel=0.03)


def test_interactive_scene_is_shown_in_a_notebook(monkeypatch):
    """The result of ``get_ipython()`` has the attribute ``kernel`` only in a
    notebook.
    """
    shell = SimpleNamespace()
    module = SimpleNamespace(get_ipython=lambda: shell)
    monkeypatch.setitem(sys.modules, "IPython", module)
    assert not hasattr(bent().plot(), "html")
    shell.kernel = object()
    picture = bent().plot()
    (srcdoc,) = re.findall(r'srcdoc="([^"]*)"', picture._repr_html_())
    assert html.unescape(srcdoc) == picture.html
    (spec,) = parse(picture.html).figures
    moved = np.array(spec["bodies"][0]["moved"])
    assert moved[-1, 2] == pytest.approx(-FORCE * LENGTH**3 / (3 * STIFFNESS))
    assert "<i>" not in picture.html
    assert "http://" not in picture.html.replace("http://www.w3.org/", "")


class Formatter(dict):
    """Stores formatting functions by type, as IPython does."""

    for_type = dict.__setitem__


@pytest.mark.parametrize("known", [{}, {pyplot.Figure: str}])
def test_notebook_displays_maps_unless_the_user_has_chosen_a_format(monkeypatch, known):
    pytest.importorskip("xarray")
    formats = {"image/png": Formatter(), "image/svg+xml": Formatter(known)}
    display = SimpleNamespace(formatters=formats)
    shell = SimpleNamespace(kernel=object(), display_formatter=display)
    module = SimpleNamespace(get_ipython=lambda: shell)
    monkeypatch.setitem(sys.modules, "IPython", module)
    data = ff.sweep("hexapod", grid="tx=0:0.02:0.01,tz=0.53", quantities=["energy"])
    figure = ff.show(data.squeeze(), quantities=["energy"])
    functions = formats["image/png"]
    assert bool(functions) == (not known)
    assert known or functions[type(figure)](figure).startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("thing", "options", "message"),
    [
        (lambda: 3.0, {}, "show: found float, expected a Robot"),
        (lambda: solve_assembly([cantilever()] * 2), {}, "Assembly of many points"),
        (cantilever, {"errors": "translation"}, "errors for a Posture"),
        (slack, {"errors": "translaton"}, "translation"),
    ],
)
def test_show_rejects_invalid_objects(thing, options, message):
    with pytest.raises(BadInput, match=message):
        ff.show(thing(), **options)


@pytest.mark.slow
def test_browser_draws_a_nominal_robot_inside_its_frame(tmp_path):
    frame = ff.load_robot("hexapod").show(interactive=True)._repr_html_()
    (tmp_path / "cell.html").write_text(f"<meta charset=utf-8>{frame}", "utf-8")
    tab = browser()
    try:
        tab.get((tmp_path / "cell.html").as_uri())
        tab.switch_to.frame(tab.find_element("tag name", "iframe"))
        wait(tab, "return document.documentElement.dataset.drawn")
        script = "return document.querySelector('.plot').data.map(t => t.name)"
        drawn = ["nominal, elastic", "nominal, rigid", "joints"]
        assert tab.execute_script(script) == drawn
        slider = "return document.querySelector('.exaggeration').offsetParent === null"
        assert tab.execute_script(slider)
        assert not [e for e in tab.get_log("browser") if e["level"] == "SEVERE"]
    finally:
        tab.quit()


def scene_of(assembly, closing=None, body=None):
    (spec,) = parse(robot_scene(assembly, closing, body, "")).figures
    return spec


def test_displacement_of_a_bar_equals_that_of_a_cantilever():
    """The deflection is w(s) = F s^2 (3 L - s) / (6 E I)."""
    (bar,) = scene_of(bent())["bodies"]
    moved, nominal = np.array(bar["moved"]), np.array(bar["nominal"])
    s = nominal[:, 0]
    line = -FORCE * s**2 * (3 * LENGTH - s) / (6 * STIFFNESS)
    np.testing.assert_allclose(moved[:, 2], line, rtol=1e-9, atol=1e-15)
    assert moved[4, 2] / moved[-1, 2] == pytest.approx(5 / 16)
    np.testing.assert_allclose(moved[:, :2], 0.0, atol=1e-12)
    assert bar["name"] == "tip <b>"
    assert bar["elastic"]


def test_arrows_show_the_forces_in_base_axes():
    (arrow,) = scene_of(bent())["forces"]
    np.testing.assert_allclose(arrow["force"], [0, 0, -FORCE], atol=1e-9)


def test_scene_contains_the_closing_motion_and_the_error_body():
    assembly = bent()
    frames = np.tile(assembly.posture.transforms, (3, 1, 1, 1))
    frames[0, 0, 2, 3] += 1e-3
    points = 1e-4 * np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1], [-1, -1, -1]])
    faces = np.array([[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]])
    body = ErrorBody("translation", points, faces, np.eye(3), np.ones(3))
    spec = scene_of(assembly, frames, body)
    np.testing.assert_allclose(np.array(spec["closing"])[:, 0, 2], [1e-3, 0, 0])
    np.testing.assert_array_equal(spec["body"]["points"], points)
    np.testing.assert_allclose(spec["body"]["origin"], [LENGTH, 0, 0])
    assert "0.1732 mm" in spec["body"]["text"]  # sqrt(3) times 0.1 mm


def test_unloaded_robot_is_drawn_without_displacement():
    spec = scene_of(bent(0.0))
    assert spec["forces"] == []
    assert spec["exaggeration"] == 1.0
    assert not np.any(spec["bodies"][0]["moved"])
