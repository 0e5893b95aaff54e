"""Studies of robots with tolerances of a drawing: statistics and worst case."""

import json

import pytest

from forcefit.inputs.table import BadInput
from forcefit.validation.study.headline import verdict
from forcefit.validation.study.report import write_study
from forcefit.validation.study.study import run_study
from forcefit.validation.study.study_file import read_study
from tests.drawn_four_bar_for_tests import COEFFICIENTS, LEVER, four_bar_file
from tests.pages_for_tests import parse

QUIET = "[checks]\npicture = false\ncrosscheck = false\nreference = false\n"
STATISTICS = "[statistics]\ndraws = {draws}\nimportance = {base}\n"


def study_of(folder, clearance="", table="", robot=""):
    (folder / "four_bar.toml").write_text(robot or four_bar_file(clearance))
    path = folder / "study.toml"
    path.write_text(f'robot = "four_bar.toml"\n{table}{QUIET}')
    return read_study(path, folder / "out")


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    folder = tmp_path_factory.mktemp("study")
    found = run_study(study_of(folder, "", STATISTICS.format(draws=4000, base=512)))
    write_study(found)
    page = parse((folder / "out" / "report.html").read_text())
    return found, page, json.loads((folder / "out" / "results.json").read_text())


def test_study_has_the_worst_case_of_the_drawing_by_hand(results):
    """0.1903 mrad: 20 um times the sum of the coefficients over the lever."""
    _, _, table = results
    worst = table["statistics"]["worst_case"]["rotation"]
    by_hand = 20e-6 * sum(COEFFICIENTS.values()) / LEVER
    assert worst["attained"] == pytest.approx(by_hand, rel=2e-3)
    assert worst["attained"] <= worst["bound"] <= 1.001 * worst["attained"]


def test_study_importance_names_the_callouts_with_the_shares_by_hand(results):
    """Errors add linearly, so a share is c^2 over the sum; intervals hold 95 %."""
    _, _, table = results
    shares = table["statistics"]["importance"]["quantities"]["rotation"]["total_index"]
    total = sum(c**2 for c in COEFFICIENTS.values())
    assert len(shares) == 4
    # |RZ| folds at zero, so only the shares of the signed motion are known by hand
    parts = table["statistics"]["importance"]["platform"]
    whole = sum(one["rotation_part"] ** 2 for one in parts.values())
    for name, one in parts.items():
        body = name.rpartition(" ")[2]
        assert name.startswith("length of ")
        expected = COEFFICIENTS[body] ** 2 / total
        assert one["rotation_part"] ** 2 / whole == pytest.approx(expected, abs=0.03)


def test_study_page_has_the_numbers_of_its_results(results):
    found, page, table = results
    rows = {row[0].text: row for row in page.table("error", "attained")[1:]}
    worst = table["statistics"]["worst_case"]
    for key in ("rotation", "translation"):
        assert rows[key][1].value == worst[key]["attained"]
        assert rows[key][2].value == worst[key]["bound"]
    shown = [number.value for number in page.numbers]
    assert worst["translation"]["bound"] in shown
    assert "tolerances of the drawing are not among these errors" in table["errors"]
    text = verdict(found)
    assert "The certified bounds leave out the tolerances of the drawing. Over" in text
    assert "Of 4000 drawn machines 4000 assemble" in text


def test_study_of_fits_states_that_bounds_use_their_mean(tmp_path):
    """The largest radial clearance of 12 H7/g6 is 1.71 of its mean."""
    study = study_of(tmp_path, 'fit = "12 H7/g6"', STATISTICS.format(draws=20, base=0))
    found = run_study(study)
    assert "fits have their mean clearance" in study.errors
    assert "with fits at their mean" in verdict(found)
    worst = found.statistics["worst_case"]["rotation"]
    alone = 20e-6 * sum(COEFFICIENTS.values()) / LEVER
    # 0.1692 mrad by four pins of 10 um, at 17.5 um each
    assert worst["attained"] == pytest.approx(alone + 0.1692e-3 * 1.75, rel=2e-3)


def test_study_without_tolerances_has_no_statistics(tmp_path):
    text = four_bar_file()
    while "[[tolerance]]" in text or "[[body.tolerance]]" in text:
        begin = min(i for i in (text.find("[[tol"), text.find("[[body.tol")) if i >= 0)
        end = text.index("mm", begin)
        text = text[:begin] + text[text.index("\n", end) :]
    assert study_of(tmp_path, robot=text).statistics is None
    with pytest.raises(BadInput, match="statistics: found one for a robot without"):
        study_of(tmp_path, "", "[statistics]\n", text)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ("[statistics]\ndraws = 1\n", "statistics.draws: found 1, expected 2 to"),
        ("[statistics]\nimportance = 3\n", "statistics.importance: found 3, expected"),
        (
            "[statistics]\nlimits = { translatoin = 1 }\n",
            "statistics.limits.translatoin: found a limit of an unknown quantity",
        ),
        ("[statistics]\nlimits = { translation = -1 }\n", "translation: found -1"),
        ("[statistics]\ndraw = 5\n", 'statistics: unknown key "draw"; did you mean'),
        ('mismatch = "spring"\n[statistics]\n', 'found it together with "mismatch"'),
    ],
)
def test_mistake_in_the_statistics_of_a_study_is_reported(tmp_path, table, message):
    with pytest.raises(BadInput) as error:
        study_of(tmp_path, "", table)
    assert message in str(error.value)
    assert "\n" not in str(error.value)
