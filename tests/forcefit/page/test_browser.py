"""Tests of the study report in a browser: figures, sliders, clicks and unit switch.

The tests run in headless Chromium with selenium, and are skipped without them.
"""

import base64
import csv
import io
import json
import shutil

import numpy as np
import pytest

from forcefit.validation.study.report import write_study
from forcefit.validation.study.study import run_study
from forcefit.validation.study.study_file import read_study
from tests.axe_for_tests import scheme, violations

pytestmark = [pytest.mark.slow, pytest.mark.exudyn]
STUDY = """
robot = "irsbot2"
grid = "tx=-0.2:0.2:0.1,tz=-0.5:-0.4:0.1"
scales = [1.0, 0.5]
[errors]
frames = ["elbow_a", "link_a", "elbow_b", "link_b", "loop2_platform", "tip"]
least = [1e-4, 1e-4, 1e-4, 1e-6, 1e-6, 1e-6]
most = [2e-2, 2e-2, 2e-2, 2e-4, 2e-4, 2e-4]
seed = 1
[pose]
tx = 0.0
tz = -0.5
"""
PATIENCE = 60  # [s] maximum waiting time on a slow machine


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    folder = tmp_path_factory.mktemp("study")
    (folder / "study.toml").write_text(STUDY)
    results = run_study(read_study(folder / "study.toml", folder / "out"))
    write_study(results)
    return results


def browser():
    """Start headless Chromium, or skip the test and state what is missing."""
    webdriver = pytest.importorskip("selenium.webdriver", reason="selenium is absent")
    names = ("chromium", "chromium-browser", "google-chrome")
    program = next(filter(None, map(shutil.which, names)), None)
    driver = shutil.which("chromedriver")
    if program is None or driver is None:
        pytest.skip("no Chromium with its chromedriver on this machine")
    options = webdriver.ChromeOptions()
    options.binary_location = program
    for word in ("headless=new", "no-sandbox", "use-angle=swiftshader",
                 "enable-unsafe-swiftshader", "window-size=1200,1000"):  # fmt: skip
        options.add_argument(f"--{word}")
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    service = webdriver.ChromeService(driver)
    return webdriver.Chrome(options=options, service=service)


@pytest.fixture(scope="module")
def tab(results):
    opened = browser()
    try:
        opened.get((results.study.folder / "report.html").resolve().as_uri())
        wait(opened, "return document.documentElement.dataset.drawn")
        yield opened
    finally:
        opened.quit()


def wait(tab, script):
    """Wait until a script returns a value, and return this value."""
    from selenium.webdriver.support.ui import WebDriverWait

    return WebDriverWait(tab, PATIENCE, 0.05).until(lambda t: t.execute_script(script))


def traces(tab):
    """Return the names and points of the traces in the scene."""
    drawn = tab.execute_script(
        "return document.querySelector('figure.scene .plot').data"
        ".map(t => [t.name, t.x, t.y, t.z])"
    )
    return {name: np.array(points, dtype=float).T for name, *points in drawn}


def slide(tab, name, value):
    """Move a slider, and wait until the scene is drawn again."""
    tab.execute_script(
        "const s = document.querySelector(`input.${arguments[0]}`);"
        "s.value = arguments[1]; document.querySelector('figure.scene .plot')"
        ".once('plotly_afterplot', () => { window.again = true; });"
        "window.again = false; s.dispatchEvent(new Event('input'))",
        name, value,
    )  # fmt: skip
    wait(tab, "return window.again")


def test_report_page_opens_without_console_errors_or_network_requests(tab):
    said = [one for one in tab.get_log("browser") if one["level"] == "SEVERE"]
    assert said == []
    fetched = tab.execute_script(
        "return performance.getEntriesByType('resource').map(e => e.name)"
        ".filter(name => !name.startsWith('data:') && !name.startsWith('blob:'))"
    )
    assert fetched == []
    figures = tab.execute_script(
        "return [...document.querySelectorAll('.plot')].map(p => p.childElementCount)"
    )
    assert all(figures)


def test_slider_exaggerates_displacements_in_proportion(tab, results):
    names = ("forced, elastic", "forced, rigid")
    most = float(tab.execute_script(
        "return document.querySelector('input.exaggeration').max"
    ))  # fmt: skip
    drawn = {}
    for share in (0.0, 0.5, 1.0):
        slide(tab, "exaggeration", share * most)
        drawn[share] = np.vstack([traces(tab)[name] for name in names])
    once, twice = drawn[0.5] - drawn[0.0], drawn[1.0] - drawn[0.0]
    assert np.nanmax(np.abs(once)) > 1.0  # mm
    np.testing.assert_allclose(twice, 2 * once, atol=1e-9)
    slide(tab, "exaggeration", 0.5 * most)


def test_closing_animation_starts_open_and_ends_closed(tab):
    steps = int(tab.execute_script("return document.querySelector('.closing').max"))
    gaps = []
    for step in (0, steps - 1):
        slide(tab, "closing", step)
        open_at = traces(tab)["still open"].reshape(-1, 3, 3)
        gaps.append(np.linalg.norm(open_at[:, 0] - open_at[:, 1], axis=1).max())
    assert gaps[0] > 1.0  # mm, exaggerated
    assert gaps[1] < 1e-6 * gaps[0]
    slide(tab, "closing", steps)
    assert "still open" not in traces(tab)


def test_click_on_map_shows_the_values_of_the_point(tab, results):
    from selenium.webdriver import ActionChains
    from selenium.webdriver.common.by import By

    plot = tab.find_element(By.CSS_SELECTOR, "figure.map .nsewdrag")
    tab.execute_script("arguments[0].scrollIntoView({block: 'center'})", plot)
    width = plot.size["width"]
    # fourth of five columns, lower of two rows
    ActionChains(tab).move_to_element_with_offset(
        plot, int(0.2 * width), int(0.25 * plot.size["height"])
    ).pause(0.3).click().perform()
    rows = wait(tab, "const r = [...document.querySelectorAll('figure.map .point tr')]"
                ".map(r => [r.cells[0].textContent, r.cells[1].dataset.v,"
                " r.cells[1].textContent]); return r.length && r")  # fmt: skip
    values = {name: value for name, value, _ in rows}
    assert float(values["tx"]) == pytest.approx(0.1)
    assert float(values["tz"]) == pytest.approx(-0.5)
    there = results.maps.sel(tx=0.1, tz=-0.5, method="nearest")
    shift = float(there["translation_error"].sel(bound="upper"))
    assert float(values["largest translation, eq. (27), over all clearances"]) == shift
    assert float(values["energy, eq. (22)"]) == float(there["energy"])
    texts = {name: text for name, _, text in rows}
    assert texts["tx"] == "100 mm"


def test_selecting_a_quantity_changes_the_map(tab, results):
    tab.execute_script(
        "const s = document.querySelector('figure.map select');"
        "s.value = [...s.options].find(o => o.text.startsWith('energy')).value;"
        "s.dispatchEvent(new Event('change'))"
    )
    drawn = wait(
        tab,
        "const t = document.querySelector('figure.map .plot');"
        "return t.layout.title.text.startsWith('energy') && t.data[0].z",
    )
    energies = results.maps["energy"].transpose("tz", "tx").values
    np.testing.assert_allclose(np.array(drawn, dtype=float), energies)


def test_table_can_be_sorted_and_copied(tab, results):
    tab.execute_script(
        "window.copied = []; navigator.clipboard.writeText = async text => {"
        " window.copied.push(text); };"
        "const t = [...document.querySelectorAll('table')].find(t =>"
        " t.rows[0].cells[1].textContent === 'made perfect');"
        "t.rows[0].cells[4].click(); t.parentNode.querySelector('.copy').click()"
    )
    (text,) = wait(tab, "return window.copied.length && window.copied")
    head, *rows = csv.reader(io.StringIO(text))
    assert head[:3] == [
        "part", "made perfect", "largest platform rotation",
    ]  # fmt: skip
    shifts = [float(row[4].removesuffix(" m")) for row in rows]
    assert shifts == sorted(shifts)
    bounds = {(one["part"], one["what"]): one for one in results.governing}
    for row in rows:
        one = bounds[row[0], row[1]]
        assert row[2] == f"{one['rotation']!r} rad"
        assert row[4] == f"{one['translation']!r} m"


def test_unit_switch_changes_to_si_and_back(tab, results):
    first = "return document.querySelectorAll('.tile .answer span')[1].textContent"
    axis = "return document.querySelector('figure.map .plot').layout.xaxis.title.text"
    own = tab.execute_script(first)
    assert (own, tab.execute_script(axis)) == ("0.794 mm", "tx [mm]")
    press = "document.getElementById('units').click()"
    tab.execute_script(press)
    wait(tab, axis + " === 'tx [m]'")
    bound = results.error["frozen"]["translation"]["upper"]
    assert tab.execute_script(first) == f"{bound:.3g} m"
    tab.execute_script(press)
    wait(tab, axis + " === 'tx [mm]'")
    assert tab.execute_script(first) == own


def test_page_contains_the_json_results(tab, results):
    held = tab.execute_script("return document.querySelector('script.results').text")
    written = (results.study.folder / "results.json").read_text()
    assert json.loads(held) == json.loads(written)


def test_page_prints_to_pdf_with_its_pictures(tab):
    pdf = tab.execute_cdp_cmd("Page.printToPDF", {"printBackground": True})
    content = base64.b64decode(pdf["data"])
    assert content.startswith(b"%PDF")
    assert len(content) > 50_000  # includes pictures


def test_every_figure_is_printed_with_dark_lines_on_white(tab):
    """WebGL drawings are replaced by pictures, and dark colours by light ones."""
    count = tab.execute_script("return document.querySelectorAll('figure').length")
    tab.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [
        {"name": "prefers-color-scheme", "value": "dark"}]})  # fmt: skip
    wait(tab, f"return document.querySelectorAll('img.print').length === {count}")
    tab.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
    shown = tab.execute_script(
        "return [...document.querySelectorAll('figure')].map(f => ["
        "getComputedStyle(f.querySelector('.plot')).display,"
        "getComputedStyle(f.querySelector('img.print')).display,"
        "f.querySelector('img.print').naturalWidth])"
    )
    assert all(one[:2] == ["none", "block"] for one in shown)
    corner = (
        "const c = document.createElement('canvas'); c.width = c.height = 9;"
        "const g = c.getContext('2d');"
        "g.drawImage(document.querySelector('figure.scene img.print'), 0, 0, 9, 9);"
        "return [...g.getImageData(0, 0, 9, 9).data]"
    )
    pixels = np.array(tab.execute_script(corner)).reshape(9, 9, 4)[..., :3]
    assert pixels.max() >= 250  # the background is white
    assert pixels.min() < 250  # the robot is visible
    tab.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "", "features": []})


def test_dark_colour_scheme_has_a_dark_page_with_light_text(tab):
    read = (
        "const s = getComputedStyle(document.body);"
        "return [s.backgroundColor, s.color, getComputedStyle("
        "document.querySelector('figure.map .xtitle')).fill].map(c =>"
        " c.match(/[0-9]+/g).slice(0, 3).map(Number))"
    )
    for name in ("dark", "light"):
        scheme(tab, name)
        dark = "true" if name == "dark" else "false"
        wait(tab, "const c = getComputedStyle(document.querySelector("
             "'figure.map .xtitle')).fill.match(/[0-9]+/g).map(Number);"
             f"return (c[0] > 128) === {dark}")  # fmt: skip
        back, ink, axis = (np.mean(c) for c in tab.execute_script(read))
        assert (back < 64) == (name == "dark")
        assert abs(ink - back) > 128
        assert abs(axis - back) > 128


def test_wide_tables_scroll_on_a_phone(tab):
    phone = {"width": 390, "height": 844, "deviceScaleFactor": 1, "mobile": True}
    tab.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", phone)
    try:
        # waits until the figures are redrawn
        wait(tab, "return document.documentElement.scrollWidth === 390")
        tall = tab.execute_script(
            "const line = parseFloat(getComputedStyle(document.querySelector('td'))"
            ".fontSize) * 2.5;"
            "return [...document.querySelectorAll('td[data-v]')].filter(td => "
            "td.getClientRects()[0] && [...td.childNodes].some(n => {"
            "const r = document.createRange(); r.selectNodeContents(n);"
            "return r.getBoundingClientRect().height > line; })).length"
        )
        assert tall == 0
    finally:
        tab.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def test_enter_key_sorts_by_the_focused_column_header(tab):
    from selenium.webdriver.common.keys import Keys

    head = tab.execute_script(
        "const t = [...document.querySelectorAll('table')].find(t =>"
        " t.rows[0].cells[1].textContent === 'made perfect');"
        "const h = t.rows[0].cells[2]; h.removeAttribute('aria-sort'); return h"
    )
    head.send_keys(Keys.ENTER)
    assert head.get_attribute("aria-sort") == "ascending"
    head.send_keys(" ")
    assert head.get_attribute("aria-sort") == "descending"


@pytest.mark.parametrize("colours", ["dark", "light"])
def test_study_page_has_no_serious_accessibility_violation(tab, colours):
    scheme(tab, colours)
    wait(tab, "return getComputedStyle(document.documentElement).colorScheme"
         f" === '{colours}'")  # fmt: skip
    assert violations(tab) == []
