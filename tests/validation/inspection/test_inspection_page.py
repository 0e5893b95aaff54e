"""Test the report page of an inspection."""

from pathlib import Path

import pytest

from tests.pages_for_tests import parse, tiles

CAMPAIGNS = Path(__file__).parents[2] / "campaigns"


def shown(run, name, folder):
    """Return the report page of a campaign."""
    page = folder / "inspection.html"
    status, _, err = run("validation", "inspect", CAMPAIGNS / name, "--report", page)
    assert status == 0, err
    return page.read_text(encoding="utf-8")


def test_page_lists_expansion_and_length_as_equivalent(run, tmp_path):
    text = shown(run, "constant_temperature", tmp_path)
    assert "<p class='verdict mixed'>" in text
    lost = text.partition('<section id="section-what-this-campaign-cannot')[2]
    assert "thermal expansion" in lost.partition("</section>")[0]
    groups = tiles(text)["Groups that cannot be distinguished"][1].split("; ")
    alike = {"thermal_expansion", "link_length"}
    assert any(alike <= set(group.rstrip(".").split(", ")) for group in groups)


def test_page_shows_readings_sigma_and_noise(run, tmp_path):
    """The true noise is 1e-5 rad and 5e-6 m."""
    text = shown(run, "encoder_offset", tmp_path)
    rows = {row[0].text: row for row in parse(text).table("reading", "measured")[1:]}
    assert list(rows) == ["rx", "ry", "rz", "tx", "ty", "tz"]
    for name, row in rows.items():
        sigma = 1e-5 if name[0] == "r" else 5e-6
        assert row[1].text == "50"
        assert [row[4].value, row[5].value] == pytest.approx([sigma, sigma])
        low, high = row[7].value, row[8].value
        assert low < row[6].value < high
        assert 0.3 * sigma < low < 2 * sigma
    assert tiles(text)["Rows"][0] == "50"
    assert parse(text).fetched == []
