"""Pages of other commands in a real browser: they draw, and contain their JSON."""

import json
from pathlib import Path

import numpy as np
import pytest

from tests.forcefit.page.test_browser import browser, slide, traces, wait

pytestmark = pytest.mark.slow
ROOT = Path(__file__).parents[3]
ERRORS = ROOT / "examples" / "irsbot2_errors.toml"


def imperfect(folder):
    """The paper's robot with an error in one link, as a file."""
    import forcefit as ff
    from forcefit.assembly.files.robot_file import write_robot

    robot = ff.load_robot("irsbot2")
    errors = np.zeros((len(robot.frames), 6))
    errors[robot.index("leg1.link_a")] = [1e-3, 1e-3, 0, 1e-4, 0, 0]
    write_robot(robot.with_errors(errors), folder / "robot.toml")
    return folder / "robot.toml"


def words_of(kind, folder):
    """A command that writes a page, and the figures that it draws at least."""
    if kind == "diagnosis":
        return ["validation", "diagnose", ROOT / "tests/campaigns/encoder_offset"], 5
    if kind == "statistics":
        return ["assembly", "statistics", "irsbot2", "--errors", ERRORS, "--pose",
                "tx=0.1,tz=-0.5", "--draws", 200], 5  # fmt: skip
    return ["assembly", "tolerances", imperfect(folder), "--grid",
            "tx=-0.1:0.1:0.1,tz=-0.5:-0.4:0.1"], 3  # fmt: skip


@pytest.fixture(params=["diagnosis", "statistics", "tolerances"])
def opened(request, tmp_path, run):
    page, written = tmp_path / "page.html", tmp_path / "results.json"
    words, figures = words_of(request.param, tmp_path)
    status, _, err = run(*words, "--report", page, "--json", written)
    assert status == 0, err
    assert page.stat().st_size < 5_000_000
    tab = browser()
    try:
        tab.get(page.resolve().as_uri())
        wait(tab, "return document.documentElement.dataset.drawn")
        yield tab, json.loads(written.read_text()), figures
    finally:
        tab.quit()


def test_page_draws_all_its_figures_and_contains_its_json(opened):
    tab, results, figures = opened
    said = [one for one in tab.get_log("browser") if one["level"] == "SEVERE"]
    assert said == []
    drawn = tab.execute_script(
        "return [...document.querySelectorAll('.plot')].map(p => p.childElementCount)"
    )
    assert len(drawn) >= figures
    assert all(drawn)
    held = tab.execute_script("return document.querySelector('script.results').text")
    assert json.loads(held) == results
    if tab.execute_script("return document.querySelectorAll('figure.scene').length"):
        most = tab.execute_script(
            "return document.querySelector('input.exaggeration').max"
        )
        still = []
        for times in (0, most):
            slide(tab, "exaggeration", times)
            still.append(np.vstack([
                points for name, points in traces(tab).items() if "forced" in name
            ]))  # fmt: skip
        assert np.nanmax(np.abs(still[1] - still[0])) > 1.0  # mm
