"""Run commands as if some packages were not installed."""

import os
import subprocess
import sys
from importlib.metadata import packages_distributions, requires
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[1]
# sitecustomize.py, which also hides the packages from child processes
_HIDING = """
import os, sys
from importlib.machinery import PathFinder

hidden, shown = set(os.environ["HIDDEN"].split()), set(os.environ["SHOWN"].split())

def is_hidden(top):
    if not shown or top in sys.stdlib_module_names or top.startswith("_sysconfigdata"):
        return top in hidden
    return top not in shown

class Hiding(PathFinder):
    @classmethod
    def find_spec(cls, name, path=None, target=None):
        if is_hidden(name.partition(".")[0]):
            return None
        return PathFinder.find_spec(name, path, target)

sys.meta_path[sys.meta_path.index(PathFinder)] = Hiding
"""


def run_without(folder, hidden, *words, shown=()):
    """Run ``forcefit`` as if packages were not installed.

    Args:
        folder: folder for ``sitecustomize.py``.
        hidden: names of the hidden packages, separated by blanks.
        words: command-line arguments.
        shown: if given, all packages except these and the standard library are hidden.

    Returns:
        Exit status, standard output, standard error.
    """
    (folder / "sitecustomize.py").write_text(_HIDING)
    search = os.pathsep.join([str(folder), str(ROOT)])
    told = {"PYTHONPATH": search, "HIDDEN": hidden, "SHOWN": " ".join(shown)}
    ran = subprocess.run(
        [sys.executable, "-m", "forcefit", *map(str, words)],
        cwd=folder, env=os.environ | told, capture_output=True, text=True, check=False,
    )  # fmt: skip
    return ran.returncode, ran.stdout, ran.stderr


def modules_of(*distributions):
    """Return the modules of distributions and of their requirements."""
    waiting, seen = [canonicalize_name(name) for name in distributions], set()
    while waiting:
        name = waiting.pop()
        if name in seen:
            continue
        seen.add(name)
        needed = [Requirement(line) for line in requires(name) or ()]
        waiting += [
            canonicalize_name(one.name)
            for one in needed
            if one.marker is None or one.marker.evaluate({"extra": ""})
        ]
    return {
        module
        for module, owners in packages_distributions().items()
        if seen & {canonicalize_name(owner) for owner in owners}
    }
