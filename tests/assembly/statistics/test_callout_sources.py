"""Random errors from callouts: a serial arm and a four-bar linkage."""

import json
from dataclasses import replace

import numpy as np
import pytest

from forcefit import BadInput
from forcefit.assembly.files.robot_file import read_robot
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.model.error_distributions import tolerance_sources
from forcefit.assembly.statistics.callout_sources import sources_of
from forcefit.assembly.statistics.experiment import Experiment
from forcefit.assembly.statistics.importance import linear_importance, source_groups
from forcefit.assembly.statistics.linear_response import linear_response
from forcefit.assembly.statistics.monte_carlo import run_draws
from tests.drawn_four_bar_for_tests import COEFFICIENTS, LEVER, four_bar_file
from tests.pages_for_tests import parse


@pytest.fixture(scope="module")
def four_bar(tmp_path_factory):
    path = tmp_path_factory.mktemp("four_bar") / "four_bar.toml"
    path.write_text(four_bar_file())
    return read_robot(path)


def test_rotation_of_a_coupler_equals_hand_calculation(four_bar):
    """The lengths are uniformly distributed within 20 um, so their standard deviation
    is 20 um / sqrt(3).
    """
    data = run_draws(Experiment(
        home_posture(four_bar), sources_of(four_bar), clearance="least", margins=False
    ), 20_000)  # fmt: skip
    root = np.sqrt(sum(c**2 for c in COEFFICIENTS.values()))
    expected = root * 20e-6 / np.sqrt(3) / LEVER
    turned = data["platform_screw"].values[:, 2]
    assert turned.std() == pytest.approx(expected, rel=0.01)


def test_importance_of_each_callout_equals_hand_calculation(four_bar):
    sources, response = sources_of(four_bar), linear_response(home_posture(four_bar))
    slopes = response.screws[2, -6 * len(four_bar.frames) :]
    shares = linear_importance(
        sources.of_numbers(slopes.reshape(1, -1, 6)), sources,
        groups := source_groups(sources, "source"),
    )[0]  # fmt: skip
    total = sum(c**2 for c in COEFFICIENTS.values())
    for (name, _), share in zip(groups, shares, strict=True):
        body = name.rpartition(" ")[2]
        assert name.startswith("length of ")
        assert share == pytest.approx(COEFFICIENTS[body] ** 2 / total, abs=1e-3)


def test_draw_does_not_depend_on_the_division_into_blocks(four_bar):
    sources = sources_of(four_bar)
    whole = sources.draw(0, 100, 5)
    assert np.array_equal(sources.draw(37, 20, 5), whole[37:57])
    assert not np.array_equal(sources.draw(0, 100, 6), whole)


def test_independent_errors_are_added_to_callouts(four_bar):
    independent = tolerance_sources(four_bar, np.eye(6)[3] * 1e-5, ("C",))
    sources, alone = sources_of(four_bar, independent), sources_of(four_bar)
    assert len(sources) == len(alone) + 1
    both, of_callouts = (
        one.errors(one.draw(0, 50_000, 1))[:, four_bar.index("C"), 3].var()
        for one in (sources, alone)
    )
    assert both - of_callouts == pytest.approx(1e-10 / 3, rel=0.05)
    assert [n for n, _ in source_groups(sources, "source")][0] == "C.TX"


def test_robot_without_tolerances_requires_an_errors_file(four_bar):
    with pytest.raises(BadInput, match=r"a \[\[tolerance\]\] table"):
        sources_of(replace(four_bar, callouts=()))


ARM = """
platform = "tip"
frame = [
    { name = "shoulder", parent = "base", joint = "revolute", actuated = true, clearance = { fit = "12 H7/g6" } },
    { name = "tip", parent = "shoulder", translation = [0.4, 0, 0] },
]
"""  # noqa: E501


def test_clearance_of_a_fit_differs_between_draws(write_file):
    """The diametral clearance of 12 H7/g6 is 6 to 35 um, with a mean of 20.5 um and a
    standard deviation of 6.09 um. The tip error is the radial clearance.
    """
    robot = read_robot(write_file(ARM))
    assert robot.frame("shoulder").clearance.radial == pytest.approx(10.25e-6)
    assert "10.25 um of 3 to 17.5" in " ".join(robot.remarks)
    sources = sources_of(robot)
    experiment = Experiment(home_posture(robot), sources, margins=False, stress=False)
    radial = 10.25e-6 + sources.draw(0, 40, 1)[:, 0]
    assert experiment.solve(0, 40)["translation"] == pytest.approx(radial, abs=1e-9)
    many = 2e6 * (10.25e-6 + sources.draw(0, 100_000, 1)[:, 0])
    assert many.mean() == pytest.approx(20.5, abs=0.06)
    assert many.std() == pytest.approx(6.09, abs=0.03)
    assert 6 <= many.min() <= many.max() <= 35
    perfect = experiment.evaluate(np.zeros((1, 1)), [0])
    assert perfect["translation"] == pytest.approx(10.25e-6, abs=1e-9)
    assert source_groups(sources, "source")[0][0] == "fit 12 H7/g6 of shoulder"


LOOSE = """
format = 2
platform = "rod"
platform_at = [0.4, 0, 0]
tolerance = [{ feature = "shoulder", datums = ["foot"], position = "0.05 mm (M)", hole = "12 H7", extent = "20 mm" }]
body = [{ name = "rod" }, { name = "stand" }]
joint = [
    { name = "foot", type = "fixed", between = ["base", "stand"], at = [0.1, 0, 0] },
    { name = "shoulder", type = "revolute", between = ["base", "rod"], at = [0, 0, 0], axis = [0, 0, 1], actuated = true, clearance = { fit = "12 H7/g6" } },
]
"""  # noqa: E501


def test_larger_hole_has_larger_zone_and_clearance(write_file):
    """A hole 12 H7 exceeds its minimum size by s, which is uniform from 0 to 18 um. The
    ends of the bore are uniform in discs of radius R = 25 um + s/2. Therefore, the
    covariance of the squared radius and the diametral clearance is cov(R^2/2, s) =
    398.25 um^3.
    """
    sources = sources_of(read_robot(write_file(LOOSE)))
    values = sources.draw(0, 200_000, 1)
    radius = 25 * np.linalg.norm(values[:, :2], axis=1)
    diametral = 20.5 + 2e6 * values[:, -1]
    size = 2 * np.maximum(0.0, radius - 25)  # smallest possible value of s
    assert (diametral > size + 6 - 1e-9).all()
    assert np.cov(radius**2, diametral)[0, 1] == pytest.approx(398.25, rel=0.03)
    assert diametral.std() == pytest.approx(6.09, abs=0.03)
    groups = dict(source_groups(sources, "source"))
    name = "position of shoulder on base and fit 12 H7/g6 of shoulder"
    assert sorted(groups[name]) == list(range(5))


def test_hole_size_that_differs_from_its_fit_is_rejected(write_file):
    expected = 'found the hole "12 H8", expected that of the fit "12 H7/g6"'
    with pytest.raises(BadInput, match=expected):
        read_robot(write_file(LOOSE.replace('hole = "12 H7"', 'hole = "12 H8"')))


def test_command_reports_the_importance_by_callout(tmp_path, run, write_file):
    answer = tmp_path / "answer.json"
    status, text, err = run(
        "assembly", "statistics", write_file(four_bar_file()), "--draws", 200,
        "--importance", 128, "--clearance", "least", "--json", answer, "-o",
        tmp_path / "draws.nc", "--limit", "translation=2e-5", "--capability",
        "--worst-case", "--report", tmp_path / "page.html",
    )  # fmt: skip
    assert status == 0, err
    assert "length of C on rocker" in text
    results = json.loads(answer.read_text())
    groups = results["importance"]["platform"]
    assert set(groups) == {
        "length of B on crank", "length of C on coupler", "length of C on rocker",
        "length of D on base",
    }  # fmt: skip
    turned = results["worst_case"]["rotation"]
    assert turned["attained"] == pytest.approx(0.1903e-3, abs=5e-8)
    shares = results["importance"]["quantities"]["translation"]["total_index"]
    name = max(shares, key=lambda group: shares[group][0])
    value, low, high = (round(100 * min(share, 1.0)) for share in shares[name])
    sentence = f"{name}: {value} % of the variance of the translation ({low} to {high}"
    assert sentence in text
    page = (tmp_path / "page.html").read_text()
    assert sentence in page.replace("&nbsp;", " ")
    columns = parse(page).table("quantity", "limit", "Cp")[1]
    assert len(columns) == 11
    above = results["exceeds"]["translation"]["probability"]
    assert results["capability"]["translation"]["ppm"]["value"] == above * 1e6


def test_position_zone_along_one_axis_depends_on_hole_size(write_file):
    """If the hole exceeds its minimum size by s, the ends of its axis are within 25 um
    + s/2 along x, and the diametral clearance is at least s + 6 um.
    """
    along_x = LOOSE.replace('hole = "12 H7"', 'hole = "12 H7", direction = [1, 0, 0]')
    sources = sources_of(read_robot(write_file(along_x)))
    values = sources.draw(0, 100_000, 1)
    assert values.shape[1] == 3
    end = 25 * abs(values[:, 0])
    diametral = 20.5 + 2e6 * values[:, -1]
    assert (diametral > 2 * np.maximum(0.0, end - 25) + 6 - 1e-9).all()
    assert end.max() > 33
