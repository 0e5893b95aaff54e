"""Which sets of effects are another explanation beside the best."""

from types import SimpleNamespace

from validation.diagnosis.selection import _rivals


def test_a_rival_neither_contains_the_best_set_nor_lies_in_it():
    """Effects a, b, c by row; the best set is {a, b}; fits are told by their letter."""
    screen = SimpleNamespace(effects=["a", "b", "c", "a"])
    members = [(0, 1), (0,), (0, 1, 2), (2,), (0, 2), (3, 2), (1, 2)]
    sets = [SimpleNamespace(members=one) for one in members]
    fits = {one: "".join(map(str, one)) for one in members if one != (1, 2)}
    # {c} and {a, c}, the better fit of the two; {b, c} was not refitted
    assert _rivals(screen, sets, fits) == ("2", "02")
