"""Reading of TOML tables, and messages about invalid values."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from forcefit.inputs.errors import checked, one_line
from forcefit.inputs.table import (
    BadInput,
    Table,
    describe,
    nearest,
    read_text,
    read_toml,
)


def table(**content):
    return Table(content, "f.toml", "place")


def message(function, *args, **kwargs):
    """Return the message of the error raised by a call."""
    with pytest.raises(BadInput) as caught:
        function(*args, **kwargs)
    return str(caught.value)


def test_bad_input_error_is_a_value_error():
    """Callers can catch ValueError."""
    assert isinstance(BadInput("x"), ValueError)


def test_bad_input_message_is_one_line():
    text = str(BadInput("a\nb\x1b[31m\u2028c\ud800"))
    assert text == r"a\nb\x1b[31m\u2028c\ud800"
    assert len(str(BadInput("x" * 10**6))) <= 800
    assert str(BadInput("größer 大 \N{MICRO SIGN}m")) == "größer 大 \N{MICRO SIGN}m"


@given(st.text(alphabet=st.characters()), st.integers(20, 90))
def test_one_line_shortens_only_long_text(text, longest):
    """An escaped character has a length of up to ten characters."""
    line = one_line(text, longest)
    assert len(line) <= 10 * longest
    assert "\n" not in line
    if text.isprintable() and len(text) <= longest:
        assert line == text


def test_nearest_suggests_or_lists_names():
    assert nearest("raduis", ["radius", "width"]) == '; did you mean "radius"?'
    assert nearest("q", ["b", "a", "a"]) == "; valid: a, b"
    assert nearest("q", []) == ""
    many = nearest("q", [f"name{i:02d}" for i in range(20)])
    assert many.endswith("name11, ...")
    assert len(nearest("x" * 10**6, ["y" * 10**5] * 20)) < 100


def test_describe_returns_a_short_text():
    deep = []
    for _ in range(100_000):
        deep = [deep]
    wide = {str(i): [1.0] * 1000 for i in range(1000)}
    for value in (deep, wide, "x" * 10**7, [["a" * 999] * 99] * 99, np.eye(99)):
        assert len(describe(value)) <= 60
    while deep:  # Python would free nested lists recursively
        deep = deep[0]


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (math.nan, "found nan"), (math.inf, "found inf"), (True, "found true"),
        ("1", "found '1'"), ([1], "found [1]"), (10**400, "found an integer of 1329"),
        (0, "found 0"), (2, "found 2"), (-1.5, "found -1.5"),
    ],
)  # fmt: skip
def test_number_out_of_range_is_rejected(value, text):
    found = message(table(a=value).number, "a", "m", above=0.0, below=2.0)
    assert found.startswith(f"f.toml: place.a: {text}")
    assert found.endswith("expected a finite number > 0 and < 2 [m]")


@pytest.mark.parametrize("value", [True, -1, 1.0, "1"])
def test_integer_key_rejects_other_values(value):
    assert "expected a whole number >= 0" in message(table(a=value).integer, "a")


@pytest.mark.parametrize(("value", "text"), [
    ("", "found '', expected a name"),
    (" \t", "expected a name"),
    (7, "found 7, expected a name"),
    ("a\nb", r"found 'a\nb', expected no control characters"),
    ("a" * 60, "of 60 characters, expected at most 50"),
])  # fmt: skip
def test_text_key_rejects_empty_long_or_multiline_text(value, text):
    assert text in message(
        table(a=value).text, "a", expected="a name", longest=50
    )  # fmt: skip


def test_read_text_accepts_byte_order_mark_and_crlf(tmp_path):
    path = tmp_path / "a.txt"
    path.write_bytes(b"\xef\xbb\xbfa\r\nb\n")
    assert read_text(path) == "a\nb\n"


def test_file_above_64_mib_is_rejected(tmp_path):
    path = tmp_path / "large"
    with path.open("wb") as file:
        file.truncate((64 << 20) + 1)
    expected = "found a file larger than 64 MiB, expected a smaller file"
    assert message(read_text, path) == f"{path}: {expected}"


@pytest.mark.parametrize(("text", "reason"), [
    ("a = 1 b", "Expected newline or end of document after a statement"),
    ("a = " + "[" * 5000, "nested too deeply"),
    ("a = " + "{a=" * 5000, "nested too deeply"),
    ("[" + "a." * 50_000 + "a]", "nested too deeply"),
    ("a = " + "9" * 5000, "found an integer with thousands of digits"),
    ("a = 1\na = 2", "Cannot overwrite a value"),
])  # fmt: skip
def test_message_about_invalid_toml_contains_the_reason(text, reason, tmp_path):
    path = tmp_path / "a.toml"
    path.write_text(text)
    found = message(read_toml, path)
    assert found.startswith(f"{path}: not valid TOML: {reason}")
    assert len(found) < len(str(path)) + 250


def test_dots_in_values_are_not_counted_as_nesting(tmp_path):
    """Dots in numbers and strings do not count towards the nesting limit."""
    path = tmp_path / "a.toml"
    numbers = ", ".join(["0.25"] * 500)
    path.write_text(f"a.b.c.d = [{numbers}]\ntext = '{'so. ' * 50}'\n")
    assert read_toml(path).content["a"]["b"]["c"]["d"] == [0.25] * 500


def test_integer_beyond_float_range_is_rejected():
    with pytest.raises(BadInput, match="--workers: found inf, expected"):
        checked("--workers", 10**400, "1", least=1)


def test_message_about_dimensionless_number_has_no_brackets():
    table = Table({"cp": -1}, "f.toml", "tolerance")
    with pytest.raises(BadInput, match="found -1, expected a finite number > 0$"):
        table.number("cp", "", above=0.0)
