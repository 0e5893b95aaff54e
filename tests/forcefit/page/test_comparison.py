"""Comparison of two runs: changed values and the size of the changes."""

import json

import pytest

from forcefit.page.comparison import compare, comparison_page
from forcefit.page.page import Provenance
from tests.pages_for_tests import parse

BEFORE = {
    "title": "robot",
    "worst_clearance": {"pose": {"translation": 8e-4, "rotation": 0.0}},
    "passed": True, "certificate": {"gap": 1e-12},
    "governing": [
        {"part": "a", "what": "clearance", "translation": 7e-4},
        {"part": "b", "what": "clearance", "translation": 6e-4},
    ],
}  # fmt: skip
AFTER = {
    "title": "robot",
    "worst_clearance": {"pose": {"translation": 4e-4, "rotation": 1e-3}},
    "passed": False, "certificate": {"gap": 3e-12}, "new": 1,
    # same entries in a different order
    "governing": [
        {"part": "b", "what": "clearance", "translation": 3e-4},
        {"part": "a", "what": "clearance", "translation": 7e-4 * (1 + 1e-12)},
    ],
}  # fmt: skip


def test_comparison_lists_every_change_with_the_largest_first():
    seen = compare(BEFORE, AFTER, ("x", "y"))
    assert [(c.place[-2:], c.before, c.after) for c in seen.changes] == [
        (("pose", "rotation"), 0.0, 1e-3),
        (("pose", "translation"), 8e-4, 4e-4),
        (("b clearance", "translation"), 6e-4, 3e-4),
        (("passed",), True, False),
    ]
    assert seen.changes[1].relative == -0.5
    assert seen.changes[1].unit == "m"
    assert seen.changes[1].name == "certified worst case, pose, platform translation"
    assert [c.place for c in seen.only] == [("new",)]
    assert compare(BEFORE, BEFORE, ("x", "x")).changes == ()


def test_comparison_lists_headline_numbers_before_components():
    first = {
        "error": {"frozen": {"upper": 1.0, "platform_screw": [1.0, 2.0]}},
        "solution": {"energy": 2.0, "wrenches": [[1e3, 0.0], [0.0, 5.0]]},
    }
    second = {
        "error": {"frozen": {"upper": 1.1, "platform_screw": [4.0, 2.0]}},
        "solution": {"energy": 2.4, "wrenches": [[1e3, -4e-13], [0.0, 5.0]]},
    }
    places = [one.place for one in compare(first, second, ("a", "b")).changes]
    # -4e-13 N is a rounding error of 1000 N and is not listed
    assert places == [
        ("solution", "energy"),
        ("error", "frozen", "upper"),
        ("error", "frozen", "platform_screw", "1"),
    ]


def test_comparison_page_has_tables_without_charts():
    text = comparison_page(compare(BEFORE, AFTER, ("x", "y")), Provenance())
    rows = {row[0].text: row[1:] for row in parse(text).tables[0][1:]}
    cells = rows["certified worst case, pose, platform translation"]
    assert [cell.text for cell in cells] == ["0.8 mm", "0.4 mm", "-50 %"]
    assert [cell.value for cell in cells[:2]] == [8e-4, 4e-4]
    assert len(text) < 100_000


def test_report_compare_accepts_pages_and_json_files(tmp_path, run):
    first, second = tmp_path / "a.json", tmp_path / "b.json"
    first.write_text(json.dumps(BEFORE))
    second.write_text(json.dumps(AFTER))
    pages = [tmp_path / "c.html", tmp_path / "d.html"]
    for page in pages:
        status, printed, err = run("report", "compare", first, second, "--report", page)
        assert (status, err) == (0, "")
    expected = (
        "certified worst case, pose, platform translation: 0.0008 to 0.0004 m (-50 %)"
    )
    assert expected in printed
    status, printed, _ = run("report", "compare", *pages, "--json", "-")
    assert status == 0
    assert json.loads(printed)["changes"] == []


@pytest.mark.parametrize(("name", "content", "message"), [
    ("none.json", None, "none.json: cannot be read: No such file"),
    ("a.json", b"\xff\xfe\xff", "a.json: cannot be read: it is not text"),
    ("a.json", b"[1]", "a.json: found a JSON list or value, expected"),
])  # fmt: skip
def test_message_about_incomparable_files_is_one_line(
    tmp_path, run, name, content, message
):
    if content is not None:
        (tmp_path / name).write_bytes(content)
    status, printed, err = run("report", "compare", tmp_path / name, tmp_path / name)
    assert (status, printed) == (2, "")
    assert message in err
    assert err.count("\n") == 1
