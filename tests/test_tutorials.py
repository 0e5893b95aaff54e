"""Run the files, commands and Python code of the tutorials.

A code block with a title is written to a file.  Blocks of type ``sh`` are run.  Each
line of an ``output`` block must occur in the output of the previous commands.  All
``python`` blocks of a page share one session.
"""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
BLOCK = re.compile(r'^```(\w+)(?: title="([^"]+)")?\n(.*?)^```', re.M | re.S)
TUTORIALS = sorted(path.stem for path in (DOCS / "tutorials").glob("*.md"))
# other pages whose printed output is checked
FOLLOWED = ("platform_stiffness", "seoul")


def blocks(page):
    """Return language, title and text of each code block on a page."""
    return BLOCK.findall(page.read_text(encoding="utf-8"))


def follow(page, folder):
    """Run the code blocks of a page in an empty folder.

    Returns:
        Number of blocks run, and number of output lines compared.
    """
    for place in ("meshes", "examples"):
        (folder / place).symlink_to(ROOT / place)
    environment = os.environ | {"PYTHONPATH": str(ROOT), "PYTHON": sys.executable}
    shell = 'set -euo pipefail\nforcefit() { "$PYTHON" -m forcefit "$@"; }\n'
    session, printed, ran, compared = [], "", 0, 0
    for language, title, text in blocks(page):
        if title:
            (folder / title).write_text(text, encoding="utf-8")
        elif language == "sh":
            done = subprocess.run(
                ["bash", "-c", shell + text], cwd=folder, env=environment,
                capture_output=True, text=True, check=False,
            )  # fmt: skip
            assert done.returncode == 0, text + done.stderr
            printed, ran = done.stdout, ran + 1
        elif language == "output":
            for line in text.strip().splitlines():
                assert line in printed, f"{line}\nis not in\n{printed}"
                compared += 1
        elif language == "python":
            session.append(text)
            # each process runs all previous blocks as well
            code = "\n".join(session)
            done = subprocess.run(
                [sys.executable, "-c", code], cwd=folder, env=environment,
                capture_output=True, text=True, check=False,
            )  # fmt: skip
            assert done.returncode == 0, text + done.stderr
            ran += 1
    return ran, compared


@pytest.mark.slow
@pytest.mark.exudyn
@pytest.mark.parametrize("name", TUTORIALS)
def test_tutorial_prints_the_documented_output(tmp_path, name):
    ran, compared = follow(DOCS / "tutorials" / f"{name}.md", tmp_path)
    assert ran > 2
    assert compared > 0


@pytest.mark.slow
@pytest.mark.parametrize("name", FOLLOWED)
def test_page_prints_the_documented_output(tmp_path, name):
    ran, compared = follow(DOCS / f"{name}.md", tmp_path)
    assert ran > 3
    assert compared > 1


@pytest.mark.slow
def test_measuring_protocol_files_are_a_valid_campaign(tmp_path):
    """The last part of the page requires real measurements and is not run."""
    page = (DOCS / "measuring_protocol.md").read_text(encoding="utf-8")
    own, mark, _ = page.partition("When the session is complete")
    assert mark
    (tmp_path / "page.md").write_text(own, encoding="utf-8")
    (tmp_path / "lab").mkdir()
    follow(tmp_path / "page.md", tmp_path / "lab")
    inspected = json.loads((tmp_path / "lab" / "inspected.json").read_text())
    assert inspected["rows"] == 5  # measured points
