"""Documentation site: formulas, scenes, search and accessibility."""

import html
import os
import re
import runpy
import subprocess
import sys

import pytest

from forcefit.assembly.robots import BUILT_IN
from tests.axe_for_tests import scheme, violations
from tests.forcefit.page.test_browser import browser, wait
from tests.test_tutorials import DOCS, ROOT, blocks

LAST = 27  # number of the last equation in the paper
SLOW = "Multiple readback operations using getImageData"


def test_theory_page_has_each_equation_of_the_paper_once():
    formulas = [t for kind, _, t in blocks(DOCS / "theory.md") if kind == "math"]
    numbers = [re.findall(r"\\tag\{(\d+)\}", formula) for formula in formulas]
    assert sorted(int(n) for found in numbers for n in found) == [*range(1, LAST + 1)]


def hooks():
    """Return the functions of docs/hooks.py."""
    pytest.importorskip("latex2mathml", reason="formulas need the packages of [docs]")
    return runpy.run_path(str(DOCS / "hooks.py"))


def test_formula_is_converted_to_mathml_with_its_number():
    text = hooks()["equation"]("x^2 \\le \\frac{1}{2}\n\\tag{2′-3′}\n")
    plain = html.unescape(text)
    assert "<msup><mi>x</mi><mn>2</mn></msup>" in plain
    assert "<mfrac><mrow><mn>1</mn></mrow><mrow><mn>2</mn></mrow></mfrac>" in plain
    assert "≤" in plain
    assert "(2′-3′)</span>" in plain


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """Build the site, and return its folder."""
    pytest.importorskip("latex2mathml", reason="the site needs the packages of [docs]")
    pytest.importorskip("material", reason="the site needs the packages of [docs]")
    folder = tmp_path_factory.mktemp("site")
    words = ["mkdocs", "build", "--quiet", "--strict", "--site-dir", str(folder)]
    done = subprocess.run([sys.executable, "-m", *words], cwd=ROOT, check=False,
                          env=os.environ | {"NO_MKDOCS_2_WARNING": "1"},
                          capture_output=True, text=True)  # fmt: skip
    assert done.returncode == 0, done.stderr
    return folder


@pytest.mark.slow
def test_no_page_shows_latex_source(site):
    for path in site.rglob("*.html"):
        text = path.read_text(encoding="utf-8")
        assert not re.search(r"\\mathbf|\\tag|\$<code>", text), path.name
    assert (site / "theory.html").read_text(encoding="utf-8").count("<math") > LAST


def pages_of(site):
    """Return all pages except the error page 404.html."""
    return [path for path in site.rglob("*.html") if path.name != "404.html"]


@pytest.mark.slow
def test_every_page_opens_without_an_error(site):
    pages = pages_of(site)
    scenes = [path for path in pages if path.parent.name == "scenes"]
    assert len(pages) - len(scenes) == len(list(DOCS.rglob("*.md")))
    tab = browser()
    try:
        for path in pages:
            tab.get(path.as_uri())
            # Chromium warns that plotly.js measures texts slowly
            log = [m for m in tab.get_log("browser") if SLOW not in m["message"]]
            assert log == [], path.name
    finally:
        tab.quit()


@pytest.mark.slow
def test_gallery_has_a_scene_of_each_robot(site):
    """Frames outside the visible area are removed."""
    drawn = {path.stem for path in (ROOT / "examples" / "drawn").glob("*.toml")}
    expected = {*BUILT_IN} | {f"drawn_{n}" if n in BUILT_IN else n for n in drawn}
    assert {path.stem for path in (site / "scenes").iterdir()} == expected
    tab = browser()
    try:
        tab.get((site / "gallery.html").as_uri())
        for name in ("hexapod", "delta"):
            show = "document.querySelector('[data-scene$=\"/%s.html\"]')%s"
            tab.execute_script(show % (name, ".scrollIntoView()"))
            wait(tab, "return " + show % (name, "?.firstChild"))
            frame = tab.execute_script("return " + show % (name, ".firstChild"))
            tab.switch_to.frame(frame)
            wait(tab, "return document.documentElement.dataset.drawn")
            assert tab.execute_script("return document.querySelector('canvas') && 1")
            tab.switch_to.default_content()
        frames = "return document.querySelectorAll('.scene-room iframe').length"
        assert tab.execute_script(frames) <= 3
    finally:
        tab.quit()


@pytest.mark.slow
def test_search_works_without_a_server(site):
    """The search term is the name Kutzbach on the page of built-in robots."""
    assert "Kutzbach" in (DOCS / "robots.md").read_text("utf-8")
    tab = browser()
    try:
        tab.get((site / "index.html").as_uri())
        field = "document.querySelector('.md-search__input')"
        tab.execute_script(f"{field}.focus()")
        tab.execute_script(
            f"{field}.value = 'Kutzbach'; {field}.dispatchEvent(new Event('keyup'))"
        )
        links = "[...document.querySelectorAll('.md-search-result__item > a')]"
        wait(tab, f"return {links}.length")
        found = tab.execute_script(f"return {links}.map(a => a.pathname)")
        assert any(path.endswith("/robots.html") for path in found)
    finally:
        tab.quit()


@pytest.mark.slow
def test_browser_displays_formulas(site):
    """A displayed fraction is taller than a letter, and a matrix is taller still."""
    tab = browser()
    try:
        tab.get((site / "theory.html").as_uri())
        height = "return document.querySelector('%s').getBoundingClientRect().height"
        row, fraction, matrix = (
            tab.execute_script(height % f"#eq-{n} math") for n in (3, 7, 15)
        )
        assert row < fraction < matrix
    finally:
        tab.quit()


@pytest.mark.slow
@pytest.mark.parametrize("colours", ["light", "dark"])
def test_no_page_has_a_serious_accessibility_violation(site, colours):
    tab = browser()
    try:
        scheme(tab, colours)
        found = {}
        for path in pages_of(site):
            tab.get(path.as_uri())
            found[path.name] = violations(tab)
        assert {name: broken for name, broken in found.items() if broken} == {}
    finally:
        tab.quit()
