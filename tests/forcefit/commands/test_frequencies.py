"""The command ``forcefit assembly frequencies``."""

import json

import pytest


def test_frequencies_come_slowest_first_with_who_bends(run):
    status, out, _ = run(
        "assembly", "frequencies", "delta", "--count", "4", "--json", "-"
    )
    answer = json.loads(out)
    assert status == 0
    assert answer["frequencies"] == sorted(answer["frequencies"])
    assert len(answer["modes"]) == 4
    for mode in answer["modes"]:
        assert sum(mode["shares"].values()) == pytest.approx(1.0)


def test_a_robot_without_mass_is_bad_input(run):
    status, out, err = run("assembly", "frequencies", "irsbot2")
    assert status == 2
    assert out == ""
    assert 'irsbot2: found no mass that moves; expected "density"' in err
