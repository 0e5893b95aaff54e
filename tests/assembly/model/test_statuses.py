"""Statuses and verdicts are those of the public format, each with a meaning."""

from forcefit.assembly.model import statuses


def test_every_status_of_a_sweep_has_a_meaning():
    assert set(statuses.OF_POINTS) <= set(statuses.MEANINGS)
    assert statuses.UNUSABLE < set(statuses.OF_POINTS)


def test_verdicts_of_a_diagnosis_are_those_of_the_public_format():
    """Sections 4 and 7 of the format."""
    assert set(statuses.DIAGNOSES) == {
        "explained", "none_needed", "ambiguous", "outside_library", "learned",
        "not_enough_rows",
    }  # fmt: skip
