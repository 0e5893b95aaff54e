"""Tests of ``.ci/plain_words.py``, which finds private words in texts."""

import runpy
from pathlib import Path

CHECK = runpy.run_path(str(Path(__file__).parents[1] / ".ci" / "plain_words.py"))
WORDS = {"side row": "held-out", "gizmo": "candidate model"}


def found(text, *names):
    """Return the private words found in a text."""
    return list(CHECK["find_words"](text, WORDS, names))


def test_listed_words_are_found_with_their_line_and_replacement():
    text = "one\n# Gizmo of a side\n    # row\n"
    assert found(text) == [
        (2, "gizmo", "candidate model"), (2, "side row", "held-out"),
    ]  # fmt: skip


def test_parts_of_longer_names_are_ignored():
    assert found("higizmo = gizmo_of(rows)") == []


def test_names_of_public_formats_are_ignored():
    assert found('row["gizmo"], a gizmo', '"gizmo"') == [(1, "gizmo", WORDS["gizmo"])]


def test_word_list_sections_are_read_without_comments():
    text = "# a\n[one]  # b\nx -> y\n\n[two]\nu v -> w\n"
    assert CHECK["read_list"](text) == {"one": {"x": "y"}, "two": {"u v": "w"}}


def test_comments_and_docstrings_are_reported_with_their_lines():
    source = '"""Title."""\n\nx = "text"  # note\n\n\ndef f():\n    """Do."""\n'
    expected = '"""Title."""\n\n# note\n\n\n\n"""Do."""'
    assert CHECK["comments"](source) == expected


def test_cpp_comments_keep_their_line_numbers():
    assert CHECK["comments"]("int x;  // note\nint y;", python=False) == " note\n"
