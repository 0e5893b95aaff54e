"""Package versions computed by setuptools_scm."""

import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
RULES = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["tool"]
NEXT = RULES["setuptools_scm"]["fallback_version"].removesuffix(".dev0")


def git(folder, *words):
    own = {"GIT_CONFIG_GLOBAL": os.devnull, "GIT_CONFIG_SYSTEM": os.devnull}
    names = ("-c", "user.name=one", "-c", "user.email=one@example.org")
    done = subprocess.run(["git", *names, *words], cwd=folder, check=True, text=True,
                          capture_output=True, env=os.environ | own)  # fmt: skip
    return done.stdout.strip()


def version(folder):
    """Return the version that a build in this folder would have."""
    words = "from setuptools_scm import Configuration, _get_version as v"
    words += "; print(v(Configuration.from_file('pyproject.toml')))"
    words = [sys.executable, "-W", "ignore", "-c", words]
    clean = {k: v for k, v in os.environ.items() if not k.startswith("SETUPTOOLS_SCM")}
    done = subprocess.run(words, cwd=folder, check=True, text=True, env=clean,
                          capture_output=True)  # fmt: skip
    return done.stdout.strip()


@pytest.fixture
def tree(tmp_path):
    pytest.importorskip("setuptools_scm")
    folder = tmp_path / "tree"
    folder.mkdir()
    shutil.copy(ROOT / "pyproject.toml", folder)
    return folder


@pytest.fixture
def repository(tree):
    if shutil.which("git") is None:
        pytest.skip("there is no git")
    git(tree, "init", "-q")
    git(tree, "add", ".")
    for k in range(3):
        git(tree, "commit", "-q", "--allow-empty", "-m", str(k))
    return tree


def test_source_tree_without_git_has_the_next_development_version(tree):
    assert version(tree) == f"{NEXT}.dev0"


def test_sdist_has_the_version_of_its_pkg_info(tree):
    (tree / "PKG-INFO").write_text("Metadata-Version: 2.2\nVersion: 0.2.0.dev7+gabc\n")
    assert version(tree) == "0.2.0.dev7+gabc"


def test_version_before_the_first_tag_counts_the_commits(repository, tmp_path):
    name = git(repository, "rev-parse", "HEAD")
    found = version(repository)
    assert found.startswith(f"{NEXT}.dev3+g")
    assert name.startswith(found.partition("+g")[2])
    shallow = tmp_path / "shallow"
    git(tmp_path, "clone", "-q", "--depth", "1", repository.as_uri(), str(shallow))
    assert version(shallow).startswith(f"{NEXT}.dev1+g")


def test_version_equals_the_tag_and_increases_with_later_commits(
    repository,
):
    git(repository, "tag", "v7.2.0")
    assert version(repository) == "7.2.0"
    git(repository, "commit", "-q", "--allow-empty", "-m", "after")
    assert version(repository).startswith("7.2.1.dev1+g")
    changed = repository / "pyproject.toml"
    changed.write_text(changed.read_text("utf-8") + "\n", encoding="utf-8")
    assert ".d20" in version(repository)
