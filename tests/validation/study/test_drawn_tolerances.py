"""Tests of studies of robots with drawing tolerances."""

import json

import numpy as np
import pytest
from scipy.optimize import brentq

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


def test_worst_case_of_drawing_tolerances_equals_hand_calculation(results):
    """The rotation is 20 um times the sum of the coefficients over the lever."""
    _, _, table = results
    worst = table["statistics"]["worst_case"]["rotation"]
    by_hand = 20e-6 * sum(COEFFICIENTS.values()) / LEVER
    assert worst["attained"] == pytest.approx(by_hand, rel=2e-3)
    assert worst["attained"] <= worst["bound"] <= 1.001 * worst["attained"]


def test_contributions_of_callouts_equal_hand_calculation(results):
    """Errors add linearly, so the contribution is c^2 over the sum of all c^2."""
    _, _, table = results
    shares = table["statistics"]["importance"]["quantities"]["rotation"]["total_index"]
    total = sum(c**2 for c in COEFFICIENTS.values())
    assert len(shares) == 4
    # the indices of abs(RZ) have no closed form
    parts = table["statistics"]["importance"]["platform"]
    whole = sum(one["rotation_part"] ** 2 for one in parts.values())
    for name, one in parts.items():
        body = name.rpartition(" ")[2]
        assert name.startswith("length of ")
        expected = COEFFICIENTS[body] ** 2 / total
        assert one["rotation_part"] ** 2 / whole == pytest.approx(expected, abs=0.03)


def test_page_of_drawing_tolerances_shows_the_results(results):
    found, page, table = results
    rows = {row[0].text: row for row in page.table("error", "attained")[1:]}
    worst = table["statistics"]["worst_case"]
    for key in ("rotation", "translation"):
        assert rows[key][1].value == worst[key]["attained"]
        assert rows[key][2].value == worst[key]["bound"]
    shown = [number.value for number in page.numbers]
    assert worst["translation"]["bound"] in shown
    assert "are in the certified worst case and in the statistics" in table["errors"]
    drawn = table["worst_clearance"]["drawn"]
    for key in ("rotation", "translation"):
        assert drawn["pose"][key] == worst[key]["bound"]
    text = verdict(found)
    begin = "For all parts within the drawing tolerances and all positions"
    assert f"{begin} within the clearances, the platform is at most" in text
    turn, shift = (1e3 * worst[key]["bound"] for key in ("rotation", "translation"))
    assert f"{turn:.3g} mrad and {shift:.3g} mm from the nominal pose" in text
    assert "Without these tolerances and for all positions within the clear" in text
    assert "Of 4000 randomly drawn machines, 4000 assemble." in text


def test_study_of_fits_reports_bounds_for_mean_clearances(tmp_path):
    """The largest radial clearance of 12 H7/g6 is 1.71 times its mean."""
    study = study_of(tmp_path, 'fit = "12 H7/g6"', STATISTICS.format(draws=20, base=0))
    found = run_study(study)
    assert (
        "energies and margins use the errors above alone, and the mean" in study.errors
    )
    assert "tolerances, with fits at their mean clearance, and for" in verdict(found)
    worst = found.statistics["worst_case"]["rotation"]
    alone = 20e-6 * sum(COEFFICIENTS.values()) / LEVER
    # four pins with 10 um cause 0.1692 mrad, and each pin has 17.5 um
    assert worst["attained"] == pytest.approx(alone + 0.1692e-3 * 1.75, rel=2e-3)


def turned_by_hand(tx):
    """Return the sum of the coefficients over the lever for a coupler position."""

    def coupler(theta):
        B = 0.1 * np.array([np.cos(theta), np.sin(theta)])
        across = np.array([0.3, 0.0]) - B
        size = np.linalg.norm(across)
        along = (0.25**2 - 0.2**2 + size**2) / (2 * size)
        normal = np.array([-across[1], across[0]]) / size
        C = B + along * across / size + np.sqrt(0.25**2 - along**2) * normal
        e3, e4 = (C - B) / 0.25, (C - [0.3, 0.0]) / 0.2
        point = (B + C) / 2 + 0.05 * np.array([-e3[1], e3[0]])
        return B / 0.1, e3, e4, point

    theta = brentq(lambda angle: coupler(angle)[3][0] - tx, 0.6, 1.7)
    e2, e3, e4, _ = coupler(theta)
    lever = 0.25 * (e4[1] * e3[0] - e4[0] * e3[1])
    return (abs(e2 @ e4) + abs(e3 @ e4) + 1 + abs(e4[0])) / abs(lever)


def test_rotation_bounds_over_the_map_equal_hand_calculation(tmp_path):
    """The rotation is 20 um times the sum of the coefficients over the lever."""
    assert turned_by_hand(0.13949) == pytest.approx(
        sum(COEFFICIENTS.values()) / LEVER, rel=2e-3
    )
    table = 'grid = "tx=0.12:0.15:0.01"\n' + STATISTICS.format(draws=2, base=0)
    quiet = table.replace("[statistics]", "[pose]\n[statistics]")
    found = run_study(study_of(tmp_path, "", quiet))
    write_study(found)
    bounds = found.maps["drawn_rotation_error"]
    by_hand = np.array([20e-6 * turned_by_hand(tx) for tx in bounds["tx"].values])
    assert (bounds.values >= by_hand * (1 - 1e-9)).all()
    assert bounds.values == pytest.approx(by_hand, rel=1.5e-3)
    table = json.loads((tmp_path / "out" / "results.json").read_text())
    over = table["worst_clearance"]["drawn"]["map"]
    assert over["rotation"] == bounds.values.max()
    assert over["points"] == 4
    turn, shift = (1e3 * over[key] for key in ("rotation", "translation"))
    size = f"{turn:.3g} mrad and {shift:.3g} mm"
    assert f"At all 4 poses of the map, it is at most {size}" in verdict(found)
    page = (tmp_path / "out" / "report.html").read_text()
    assert "largest rotation over all parts within tolerance" in page
    # the four-bar has one closure and no description
    assert ">four_bar. " in page
    assert " frames, 1 closure; " in page


def test_study_without_tolerances_has_no_statistics(tmp_path):
    text = four_bar_file()
    while "[[tolerance]]" in text or "[[body.tolerance]]" in text:
        begin = min(i for i in (text.find("[[tol"), text.find("[[body.tol")) if i >= 0)
        end = text.index("mm", begin)
        text = text[:begin] + text[text.index("\n", end) :]
    assert study_of(tmp_path, robot=text).statistics is None
    with pytest.raises(BadInput, match="found this table for a robot without"):
        study_of(tmp_path, "", "[statistics]\n", text)


@pytest.mark.parametrize(("table", "message"), [
    ("[statistics]\ndraws = 1\n", "statistics.draws: found 1, expected 2 to"),
    ("[statistics]\nimportance = 3\n", "statistics.importance: found 3, expected"),
    ("[statistics]\nlimits = { translatoin = 1 }\n",
     "statistics.limits.translatoin: found a limit of an unknown quantity"),
    ("[statistics]\nlimits = { translation = -1 }\n", "translation: found -1"),
    ("[statistics]\ndraw = 5\n", 'statistics: unknown key "draw"; did you mean'),
    ('mismatch = "spring"\n[statistics]\n', 'found this table and "mismatch"'),
])  # fmt: skip
def test_invalid_statistics_table_is_rejected(tmp_path, table, message):
    with pytest.raises(BadInput) as error:
        study_of(tmp_path, "", table)
    assert message in str(error.value)
    assert "\n" not in str(error.value)
