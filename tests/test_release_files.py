"""Files of a release: citation, conda recipe and issue templates."""

import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]


def names_and_bounds(lines):
    """Return the version bounds of requirements by name."""
    pairs = (re.match(r"([\w-]+)\s*(.*)", line) for line in lines)
    return {m[1]: m[2] for m in pairs if m}


def test_citation_names_the_paper_of_the_method():
    yaml = pytest.importorskip("yaml")
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text("utf-8"))
    (paper,) = citation["references"]
    # authors as in the preprint hal-01941644
    assert [a["family-names"] for a in paper["authors"]] == [
        "Corradi", "Caro", "Chablat", "Cardou",
    ]  # fmt: skip
    assert paper["doi"] == "10.1109/ICRA.2014.6907450"
    assert " ".join(paper["title"].split()) in " ".join(citation["abstract"].split())


def test_conda_recipe_has_the_version_bounds_of_pyproject():
    yaml = pytest.importorskip("yaml")
    recipe = yaml.safe_load((ROOT / "conda/recipe.yaml").read_text("utf-8"))
    conda = names_and_bounds(recipe["requirements"]["run"])
    conda["cvxpy"] = conda.pop("cvxpy-base")  # without the solvers that cvxpy installs
    wanted = names_and_bounds(PROJECT["dependencies"])
    left_out = {"exudyn", "pytetwild"}
    assert conda.pop("python") == PROJECT["requires-python"]
    assert conda == {k: v for k, v in wanted.items() if k not in left_out}


def test_issue_templates_have_a_name_and_questions():
    yaml = pytest.importorskip("yaml")
    templates = sorted((ROOT / ".github/ISSUE_TEMPLATE").glob("*.yml"))
    forms = [t for t in templates if t.name != "config.yml"]
    assert len(forms) == 3
    for path in forms:
        form = yaml.safe_load(path.read_text("utf-8"))
        assert form["name"]
        assert form["description"]
        ids = [question["id"] for question in form["body"]]
        assert len(set(ids)) == len(ids) > 0
        assert all(question["attributes"]["label"] for question in form["body"])
