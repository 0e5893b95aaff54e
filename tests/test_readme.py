"""The README's example runs, and its equation map and links are valid."""

import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")


def python_example():
    """Return the Python example in the README."""
    (code,) = re.findall(r"```python\n(.*?)```", README, flags=re.S)
    return code


def test_readme_python_example_runs_within_20_lines():
    code = python_example()
    assert len(code.strip().splitlines()) <= 20
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True,
                          check=False)  # fmt: skip
    assert done.returncode == 0, done.stderr
    zone, energy, *_ = lines = done.stdout.splitlines()
    assert len(lines) == 4
    # the example must require forces for its assembly
    assert zone.startswith("assembles by clearance: False, margin ")
    assert float(energy.split()[1]) > 1.0  # mJ


def test_every_module_of_the_equation_map_exists():
    rows = [line for line in README.splitlines() if line.startswith("| (")]
    names = {
        n
        for row in rows
        for n in re.findall(r"`forcefit\.((?:stiffness|assembly)\.\S+)`", row)
    }
    assert len(names) >= 7
    for name in names:
        assert (ROOT / (name.replace(".", "/") + ".py")).is_file(), name


def test_every_relative_link_of_the_readme_exists():
    for target in re.findall(r"\]\(([^)#]+)\)", README):
        assert (ROOT / target).exists(), target
