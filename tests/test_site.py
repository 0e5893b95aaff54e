"""The site: formulas with the numbers of the paper; pages open from a folder."""

import html
import os
import re
import runpy
import subprocess
import sys

import pytest

from tests.axe_for_tests import scheme, violations
from tests.forcefit.page.test_browser import browser
from tests.test_tutorials import DOCS, ROOT, blocks

LAST = 27  # number of the paper's last equation


def test_theory_page_has_each_equation_of_the_paper_once():
    formulas = [t for kind, _, t in blocks(DOCS / "theory.md") if kind == "math"]
    numbers = [re.findall(r"\\tag\{(\d+)\}", formula) for formula in formulas]
    assert sorted(int(n) for found in numbers for n in found) == [*range(1, LAST + 1)]


def hooks():
    """The functions of docs/hooks.py."""
    pytest.importorskip("latex2mathml", reason="formulas need the packages of [docs]")
    return runpy.run_path(str(DOCS / "hooks.py"))


def test_formula_becomes_mathml_with_its_number():
    text = hooks()["equation"]("x^2 \\le \\frac{1}{2}\n\\tag{2′-3′}\n")
    plain = html.unescape(text)
    assert "<msup><mi>x</mi><mn>2</mn></msup>" in plain
    assert "<mfrac><mrow><mn>1</mn></mrow><mrow><mn>2</mn></mrow></mfrac>" in plain
    assert "≤" in plain
    assert "(2′-3′)</span>" in plain


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """Folder of the site."""
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
def test_no_page_shows_the_source_of_a_formula(site):
    for path in site.rglob("*.html"):
        text = path.read_text(encoding="utf-8")
        assert not re.search(r"\\mathbf|\\tag|\$<code>", text), path.name
    assert (site / "theory.html").read_text(encoding="utf-8").count("<math") > LAST


def pages_of(site):
    """All pages but the one that a server shows in place of one that is missing."""
    return [path for path in site.rglob("*.html") if path.name != "404.html"]


@pytest.mark.slow
def test_every_page_opens_from_its_folder_without_an_error(site):
    pages = pages_of(site)
    assert len(pages) == len(list(DOCS.rglob("*.md")))
    tab = browser()
    try:
        for path in pages:
            tab.get(path.as_uri())
            assert tab.get_log("browser") == [], path.name
    finally:
        tab.quit()


@pytest.mark.slow
def test_formulas_are_drawn_by_the_browser(site):
    """A fraction is higher than a letter, and a matrix higher than a fraction."""
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
def test_no_page_breaks_a_serious_rule_of_accessibility(site, colours):
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
