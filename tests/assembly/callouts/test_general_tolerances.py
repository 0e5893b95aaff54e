"""Tables of ISO 2768 and parsing of tolerances."""

import pytest

from forcefit.assembly.callouts.general_tolerances import (
    linear_tolerance,
    parse_general,
    perpendicularity_tolerance,
)
from forcefit.assembly.callouts.written_tolerances import parse_length, parse_width
from forcefit.inputs.table import BadInput

# ISO 2768-1 [mm]: upper limit of the length, and tolerances of classes f, m, c, v
LENGTHS = """
3 .05 .1 .2 -
6 .05 .1 .3 .5
30 .1 .2 .5 1
120 .15 .3 .8 1.5
400 .2 .5 1.2 2.5
1000 .3 .8 2 4
2000 .5 1.2 3 6
4000 - 2 4 8
"""


@pytest.mark.parametrize("row", LENGTHS.split("\n")[1:-1])
def test_general_length_tolerances_equal_values_of_the_standard(row):
    length, *values = row.split()
    for kind, value in zip("fmcv", values, strict=True):
        if value != "-":
            found = linear_tolerance(float(length) * 1e-3, kind)
            assert found == pytest.approx(float(value) * 1e-3)


def test_general_perpendicularity_tolerances_equal_values_of_the_standard():
    worked = {"H": (0.2, 0.3, 0.4, 0.5), "K": (0.4, 0.6, 0.8, 1.0)}
    for kind, widths in worked.items():
        sides = (0.1, 0.3, 1.0, 3.0)
        found = [perpendicularity_tolerance(side, kind) for side in sides]
        assert found == pytest.approx([1e-3 * width for width in widths])
    found = [perpendicularity_tolerance(side, "L") for side in (0.3, 1.0, 3.0)]
    assert found == pytest.approx([1e-3, 1.5e-3, 2e-3])


@pytest.mark.parametrize(
    ("mm", "kind"), [(0.3, "m"), (5000, "m"), (2.0, "v"), (3000, "f")]
)
def test_length_outside_general_tolerances_is_rejected(mm, kind):
    with pytest.raises(BadInput, match="expected"):
        linear_tolerance(mm * 1e-3, kind)


def test_valid_tolerance_texts_are_parsed():
    assert parse_general("ISO 2768-mK") == ("m", "K")
    assert parse_general("ISO 2768 - f") == ("f", "")
    assert parse_length("452 +- 0.1 mm") == pytest.approx((0.452, 1e-4))
    assert parse_length("452 mm ± 50 um") == pytest.approx((0.452, 5e-5))
    assert parse_width("0.05 mm") == (pytest.approx(5e-5), False)
    assert parse_width("0.05 mm (M)") == (pytest.approx(5e-5), True)
    assert parse_width(5e-5) == (5e-5, False)


@pytest.mark.parametrize("value", ["0.05", "-1 mm", 0, True, [1], "0 mm", "1e9 m"])
def test_invalid_tolerance_width_is_rejected(value):
    with pytest.raises(BadInput, match=r"expected a width > 0 such as \"0.05 mm\""):
        parse_width(value)


@pytest.mark.parametrize("value", ["452", "452 +- 0.1", "1 +- 2 mm", 452.0, "5 +- 0 m"])
def test_length_without_valid_tolerance_is_rejected(value):
    with pytest.raises(BadInput, match=r"expected a length such as"):
        parse_length(value)
