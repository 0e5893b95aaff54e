"""The check of private words in sources and pages finds them and nothing else."""

import runpy
from pathlib import Path

CHECK = runpy.run_path(str(Path(__file__).parents[1] / ".ci" / "plain_words.py"))
WORDS = {"kept aside": "held-out", "story": "candidate model"}


def found(text, *names):
    """Return what the check finds in a text."""
    return list(CHECK["find_words"](text, WORDS, names))


def test_words_are_found_with_line_and_replacement():
    text = "one\n# Story of rows kept\n    # aside\n"
    assert found(text) == [
        (2, "story", "candidate model"), (2, "kept aside", "held-out"),
    ]  # fmt: skip


def test_parts_of_longer_names_are_not_found():
    assert found("history = story_of(rows)") == []


def test_names_of_public_formats_are_not_found():
    assert found('row["story"], a story', '"story"') == [(1, "story", WORDS["story"])]


def test_sections_of_a_word_list_are_read_without_comments():
    text = "# a\n[one]  # b\nx -> y\n\n[two]\nu v -> w\n"
    assert CHECK["read_list"](text) == {"one": {"x": "y"}, "two": {"u v": "w"}}
