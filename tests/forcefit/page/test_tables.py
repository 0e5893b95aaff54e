"""Tests of cells, headings and colours in the HTML of a page."""

import re

import pytest

from forcefit.page.comparison import compare, comparison_page
from forcefit.page.page import Page, Provenance, page
from forcefit.page.tables import Column, table


def test_table_headers_can_have_keyboard_focus():
    text = table(["part", Column("shift", "m")], [["a", 1e-3]])
    heads = re.findall(r"<th( [^>]*)>", text)
    assert len(heads) == 2
    assert all("tabindex=0" in head and "scope=col" in head for head in heads)


@pytest.mark.parametrize(
    ("good", "kind", "word"),
    [(True, "good", "OK"), (None, "mixed", "Caution"), (False, "bad", "Not OK")],
)
def test_verdict_has_a_colour_and_a_label(good, kind, word):
    """The label is required by readers who cannot distinguish the colours."""
    text = page(Page("t", "v", good, [], "", [], [], Provenance(), {}))
    assert f"<p class='verdict {kind}'><strong>{word}:</strong> v</p>" in text


def test_no_line_break_between_number_and_unit():
    """Counts such as 12 poses have no unit and may be wrapped."""
    verdict = "At most 0.794 mm and 13 mrad, 1.926 J, over 12 poses of 2 modes: 5 %."
    text = page(Page("t", verdict, True, [], "", [], [], Provenance(), {}))
    (shown,) = re.findall(r"<p class='verdict good'>(.*?)</p>", text)
    assert shown == "<strong>OK:</strong> " + (
        "At most 0.794&nbsp;mm and 13&nbsp;mrad, 1.926&nbsp;J, over 12 poses of "
        "2 modes: 5&nbsp;%."
    )


def test_long_comparison_folds_small_changes():
    """The folded table is not printed, which limits the number of pages."""
    first = {"robot": "r", "values": {f"v{k}": 1.0 for k in range(1000)}}
    second = {"robot": "r", "values": {f"v{k}": 1.0 + k / 1e3 for k in range(1000)}}
    text = comparison_page(compare(first, second, ("a", "b")), Provenance())
    at_once, _, folded = text.partition("<details>")
    rows = at_once.count("<tr>") - 1
    assert 20 <= rows <= 100
    assert "v999" in at_once
    assert f"<summary>{999 - rows} more changes</summary>" in folded
    assert folded.partition("</details>")[0].count("<tr>") == 999 - rows + 1
