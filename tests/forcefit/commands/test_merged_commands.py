"""Combinations of options that are not valid, and equivalent options."""

import json

import numpy as np
import pytest

CURVE = """
[[piece]]
end = [0.4, 0.0, 0.0]
section = { radius = 0.02 }
"""
MATERIAL = ["--young", "6e10", "--poisson", "0.3"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["assembly", "solve", "five_bar", "--quantities", "margni"],
         '--quantities: found "margni"; did you mean "margin"'),
        (["assembly", "solve", "five_bar", "--quantities", "margin", "--load", "fx=1"],
         "--load: found together with --quantities margin"),
        (["assembly", "solve", "five_bar", "--quantities", "margin", "--state",
          "exact"], "--state: found together with --quantities margin"),
        (["assembly", "solve", "five_bar", "--state", "nominal"],
         "--state: found 'nominal'"),
        (["assembly", "plot", "a.nc"], "plot: found no output to write"),
        (["assembly", "plot", "a.nc", "--csv", "a.csv", "--kind", "tornado"],
         "--kind: found without --figure; add --figure"),
        (["assembly", "plot", "a.nc", "--figure", "a.png", "--rows", "kind"],
         "--rows: found without --csv; add --csv"),
        (["stiffness", "beam", *MATERIAL, "--radius", "0.1"],
         "--length: missing; expected the length of a straight"),
        (["stiffness", "beam", "c.toml", *MATERIAL, "--radius", "0.1"],
         "c.toml: found together with --length, --along"),
        (["stiffness", "beam", "c.toml", *MATERIAL, "--along", "x"],
         "c.toml: found together with --length"),
        (["stiffness", "fea", "s.stl", *MATERIAL, "--tip", "z=1"],
         "--base: missing; expected an interface"),
        (["stiffness", "fea", "s.stl", *MATERIAL, "--base", "z=1"],
         "--tip: missing; expected an interface"),
        (["stiffness", "compare", *MATERIAL, "--radius", "0.1"],
         "SURFACE: missing; expected a file of the surface"),
        (["stiffness", "compare", "s.stl", *MATERIAL, "--ratios", "5,10"],
         "SURFACE: found together with --ratios"),
        (["stiffness", "compare", *MATERIAL, "--ratios", "5,10", "--tip", "z=1"],
         "--tip: found together with --ratios"),
        (["stiffness", "library", "l", "--at", "length=1", "--to", "csv"],
         "library: found both --at and --to"),
        (["stiffness", "library", "l.toml", "--key", "a"],
         "--key: found with l.toml, expected the folder of a library"),
        (["stiffness", "library", "l", "--workers", "2"],
         "--workers: found with l, expected a build file (.toml)"),
        (["stiffness", "library", "l", "--key", "a"],
         "--key: found without --to; add --to"),
        (["stiffness", "library", "l", "--family", "a"],
         "--family: found without --at; add --at"),
        (["stiffness", "library", "l", "--to", "csv", "--json", "x.json"],
         "--json: found together with --to csv"),
    ],
)  # fmt: skip
def test_incompatible_options_have_a_one_line_message(
    run, tmp_path, monkeypatch, words, message
):
    monkeypatch.chdir(tmp_path)
    status, out, err = run(*words)
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert message in err
    assert list(tmp_path.iterdir()) == []


def test_beam_file_and_options_have_equal_compliance(run, tmp_path):
    (tmp_path / "c.toml").write_text(CURVE)
    by_file = run("stiffness", "beam", tmp_path / "c.toml", *MATERIAL, "--json", "-")
    options = ["--length", "0.4", "--radius", "0.02"]
    by_options = run("stiffness", "beam", *options, *MATERIAL, "--json", "-")
    one, other = (
        np.array(json.loads(out)["compliance"]) for _, out, _ in (by_file, by_options)
    )
    scale = np.sqrt(np.diag(other))
    np.testing.assert_allclose(one / np.outer(scale, scale),
                               other / np.outer(scale, scale), atol=1e-9)  # fmt: skip


def test_margins_computed_alone_equal_those_of_solve(run):
    _, whole, _ = run("assembly", "solve", "irsbot2", "--json", "-")
    status, margins, _ = run(
        "assembly", "solve", "irsbot2", "--quantities", "margin,margin_free", "--json",
        "-",
    )  # fmt: skip
    found, expected = json.loads(margins)["zone"], json.loads(whole)["zone"]
    assert status == 0
    assert set(json.loads(margins)) == {"robot", "zone"}
    assert found["margin"] == expected["margin"]
    assert found["margin_free"] == expected["margin_free"]
