"""Limits as written on the command line."""

import pytest

from forcefit.assembly.statistics.quantities import UNITS, limit_names, parse_limit
from forcefit.inputs.table import BadInput


@pytest.mark.parametrize("name", limit_names())
def test_limit_is_read_with_and_without_spaces(name):
    assert parse_limit(f"{name}=2.5e-4") == (name, 2.5e-4)
    assert parse_limit(f" {name} = 3 ") == (name, 3.0)
    assert UNITS[name]


@pytest.mark.parametrize("number", ["0", "-1e-9", "inf", "nan", "", "2 J", "1=2"])
def test_limit_that_is_not_a_positive_number_is_refused_with_its_text(number):
    with pytest.raises(BadInput) as error:
        parse_limit(f"force={number}")
    expected = f'--limit force: found "{number}", expected a number > 0'
    assert str(error.value) == expected


def test_unknown_quantity_is_refused_with_the_nearest_name():
    with pytest.raises(BadInput, match='unknown quantity "enrgy".*energy'):
        parse_limit("enrgy=2")
    for name in ("translation_lower", "duality_gap", "platform_screw", ""):
        with pytest.raises(BadInput, match=f'^--limit: unknown quantity "{name}"'):
            parse_limit(f"{name}=1")
