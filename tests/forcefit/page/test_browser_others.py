"""Report pages of all commands except ``study``, opened in a browser."""

import json
from pathlib import Path

import numpy as np
import pytest

from tests.axe_for_tests import scheme, violations
from tests.forcefit.page.test_browser import browser, slide, traces, wait

pytestmark = [pytest.mark.slow, pytest.mark.exudyn]
ROOT = Path(__file__).parents[3]
EXAMPLES = ROOT / "examples"
CAMPAIGN = ROOT / "tests" / "campaigns" / "encoder_offset"
ERRORS = EXAMPLES / "irsbot2_errors.toml"
POSE = ("--pose", "tx=0.1,tz=-0.5")
# minimum number of figures on each page
FIGURES = {
    "diagnosis": 5, "statistics": 5, "tolerances": 3, "path": 4, "steps": 3,
    "inspect": 1, "iso": 2, "crosscheck": 1, "crosscheck_grid": 0, "stiffness_check": 0,
    "validity": 1, "fea": 1, "comparison": 0,
}  # fmt: skip


def imperfect(folder, name, frame):
    """Write a robot file with an error in one frame."""
    import forcefit as ff
    from forcefit.assembly.files.robot_file import write_robot

    robot = ff.load_robot(name)
    errors = np.zeros((len(robot.frames), 6))
    errors[robot.index(frame)] = [1e-3, 1e-3, 0, 1e-4, 0, 0]
    write_robot(robot.with_errors(errors), folder / f"{name}.toml")
    return folder / f"{name}.toml"


def results(folder):
    """Write two JSON files with different results."""
    files = [folder / "first.json", folder / "second.json"]
    for k, file in enumerate(files):
        file.write_text(json.dumps({"robot": "r", "energy": 1.0 + k}))
    return files


def words_of(kind, folder):
    """Return the command that writes a page."""
    robot = imperfect(folder, "irsbot2", "leg1.link_a")
    hexapod = imperfect(folder, "hexapod", "leg2.tip")
    crosscheck = ["validation", "crosscheck", robot, "--links", "spring"]
    commands = {
        "diagnosis": ["validation", "diagnose", CAMPAIGN],
        "statistics": ["assembly", "statistics", "irsbot2", "--errors", ERRORS, *POSE,
                       "--draws", 200],
        "tolerances": ["assembly", "tolerances", robot, "--grid",
                       "tx=-0.1:0.1:0.1,tz=-0.5:-0.4:0.1"],
        "path": ["assembly", "path", "hexapod", "--path", EXAMPLES / "hexapod_path.csv",
                 "--points", 41],
        "steps": ["assembly", "steps", hexapod, EXAMPLES / "assembly_steps.toml"],
        "inspect": ["validation", "inspect", CAMPAIGN],
        "iso": ["validation", "inspect", CAMPAIGN, "--iso"],
        "crosscheck": [*crosscheck, *POSE],
        "crosscheck_grid": [*crosscheck, "--grid", "tx=0:0.1:0.1,tz=-0.5"],
        "stiffness_check": [*crosscheck, *POSE, "--state", "exact"],
        "validity": ["validation", "validity", robot, "--grid", "tx=0:0.1:0.1,tz=-0.5"],
        "fea": ["stiffness", "fea", ROOT / "meshes" / "distal_plain.stl", "--base",
                "z=0", "--tip", "z=0.452", "--young", "6e10", "--poisson", 0.3,
                "--accuracy", 0.05],
        "comparison": ["report", "compare", *results(folder)],
    }  # fmt: skip
    return commands[kind]


@pytest.fixture(scope="module")
def chromium():
    opened = browser()
    yield opened
    opened.quit()


@pytest.fixture(scope="module")
def pages():
    """Return a dictionary for pages and their JSON results by type."""
    return {}


@pytest.fixture(params=FIGURES)
def opened(request, tmp_path_factory, run, chromium, pages):
    if request.param not in pages:
        folder = tmp_path_factory.mktemp(request.param)
        page, written = folder / "page.html", folder / "results.json"
        words = words_of(request.param, folder)
        status, _, err = run(*words, "--report", page, "--json", written)
        assert status == 0, err
        pages[request.param] = page, written
    page, written = pages[request.param]
    assert page.stat().st_size < 5_000_000
    scheme(chromium, "light")
    chromium.get_log("browser")
    chromium.get(page.resolve().as_uri())
    wait(chromium, "return document.documentElement.dataset.drawn")
    return chromium, json.loads(written.read_text()), FIGURES[request.param]


def test_page_shows_all_figures_and_contains_json(opened):
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


def test_page_fits_phone_and_paper_width(opened):
    tab, *_ = opened
    wait(tab, "return document.querySelectorAll('img.print').length === "
         "document.querySelectorAll('figure').length")  # fmt: skip
    before = tab.execute_script("return document.querySelector('.xtitle')?.style.fill")
    scheme(tab, "dark")  # the figures are redrawn
    wait(tab, "return (document.querySelector('.xtitle')?.style.fill || 0) !== "
         f"'{before}'")  # fmt: skip
    for width in ("phone", "paper"):
        assert beyond(tab, width) == []


@pytest.mark.parametrize("colours", ["light", "dark"])
def test_page_has_no_serious_accessibility_violation(opened, colours):
    tab, *_ = opened
    scheme(tab, colours)
    wait(tab, "return getComputedStyle(document.documentElement).colorScheme"
         f" === '{colours}'")  # fmt: skip
    assert violations(tab) == []


def beyond(tab, width):
    """Return the elements that extend beyond the width of a phone or an A4 page."""
    pixels = {"phone": 390, "paper": 680}[width]
    size = {"width": pixels, "height": 844, "deviceScaleFactor": 1,
            "mobile": width == "phone"}  # fmt: skip
    media = "print" if width == "paper" else "screen"
    tab.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": media})
    tab.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    try:
        if width == "phone":  # the figures are redrawn
            wait(tab, "return [document.documentElement.scrollWidth, "
                 "...[...document.querySelectorAll('.main-svg')].map(svg => "
                 f"svg.clientWidth)].every(width => width <= {pixels})")  # fmt: skip
            return tab.execute_script(  # figures that overlap the text below
                "return [...document.querySelectorAll('figure')].filter(f => "
                "[...f.querySelectorAll('.main-svg')].some(svg => "
                "svg.getBoundingClientRect().bottom > "
                "f.getBoundingClientRect().bottom + 1)).map(f => f.ariaLabel)"
            )
        return tab.execute_script(
            "return [...document.querySelectorAll('table, img.print, p, li, .tile')]"
            ".filter(e => e.getBoundingClientRect().right > arguments[0])"
            ".map(e => e.textContent.slice(0, 60))", pixels + 1,
        )  # fmt: skip
    finally:
        tab.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
        tab.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})
