"""Limits as they are written on the command line."""

import pytest

from assembly.statistics.quantities import UNITS, limit_names, parse_limit
from forcefit.inputs.table import BadInput


@pytest.mark.parametrize("name", limit_names())
def test_a_limit_is_a_quantity_and_a_number_with_spaces_or_without(name):
    assert parse_limit(f"{name}=2.5e-4") == (name, 2.5e-4)
    assert parse_limit(f" {name} = 3 ") == (name, 3.0)
    assert UNITS[name]


@pytest.mark.parametrize("number", ["0", "-1e-9", "inf", "nan", "", "2 J", "1=2"])
def test_a_limit_that_is_no_number_above_zero_is_quoted(number):
    with pytest.raises(BadInput) as error:
        parse_limit(f"force={number}")
    expected = f'--limit force: found "{number}", expected a number > 0'
    assert str(error.value) == expected


def test_unknown_quantities_are_quoted_with_the_nearest():
    with pytest.raises(BadInput, match='unknown quantity "enrgy".*energy'):
        parse_limit("enrgy=2")
    for name in ("translation_lower", "duality_gap", "platform_screw", ""):
        with pytest.raises(BadInput, match=f'^--limit: unknown quantity "{name}"'):
            parse_limit(f"{name}=1")


def test_long_words_are_cut():
    for text in ("x" * 99, "force=" + "9x" * 99):
        with pytest.raises(BadInput) as error:
            parse_limit(text)
        quoted = str(error.value).split('"')[1]
        assert len(quoted) == 60
        assert quoted in text
