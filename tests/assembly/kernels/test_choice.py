"""Selection of the compiled module, and equality of its results."""

import hashlib
import os
import subprocess
import sys
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import pytest

from forcefit.assembly.kernels import choice
from forcefit.assembly.kernels.choice import LEVELS, chosen, kernels, levels_here
from forcefit.inputs.errors import BadInput

PROGRAM = Path(__file__).with_name("levels_for_tests.py")
ROOT = Path(__file__).parents[3]
# additional processor flags of each level, x86-64 psABI, table 3.1
FLAGS = {
    "x86-64-v2": "cx16 lahf_lm popcnt pni ssse3 sse4_1 sse4_2",
    "x86-64-v3": "avx avx2 bmi1 bmi2 f16c fma abm movbe",
    "x86-64-v4": "avx512f avx512bw avx512cd avx512dq avx512vl",
}
x86_64 = pytest.mark.skipif(not levels_here(), reason="no levels elsewhere")


def run(level, *words):
    """Run Python code; return the exit status and both outputs."""
    given = os.environ | {"FORCEFIT_MARCH": level, "PYTHONPATH": str(ROOT)}
    done = subprocess.run([sys.executable, *map(str, words)], env=given, text=True,
                          capture_output=True, cwd=ROOT, check=False)  # fmt: skip
    return done.returncode, done.stdout, done.stderr


@cache
def digests(level):
    """Return the name of the module used, and digests of its results by name."""
    status, out, err = run(level, PROGRAM)
    assert status == 0, err
    first, *rows = out.splitlines()
    return first.split("\t"), dict(row.split("\t") for row in rows)


@x86_64
@pytest.mark.parametrize("level", LEVELS)
def test_every_instruction_level_gives_bit_identical_results(level):
    """Operations have the same order and rounding on every processor."""
    if level not in levels_here():
        pytest.skip("this processor has not got it")
    name = "_" + level.replace("-", "_")
    lanes = {"x86-64-v2": "2", "x86-64-v3": "4", "x86-64-v4": "8"}[level]
    (used, of), found = digests(level)
    assert (used, of) == (name, lanes)
    assert found == digests(levels_here()[0])[1]
    assert len(found) == 27


@pytest.mark.skipif(not Path("/proc/cpuinfo").exists(), reason="no list of flags")
@x86_64
def test_available_levels_depend_on_the_processor_flags():
    cpuinfo = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    flags = next(line for line in cpuinfo.splitlines() if line.startswith("flags"))
    wanted, expected = set(), []
    for level, more in FLAGS.items():
        wanted |= set(more.split())
        if wanted <= set(flags.split()):
            expected.append(level)
    assert levels_here() == expected


@x86_64
def test_highest_instruction_level_is_loaded_by_default(monkeypatch):
    monkeypatch.delenv("FORCEFIT_MARCH", raising=False)
    assert chosen().__name__.endswith(levels_here()[-1].replace("-", "_"))


@x86_64
@pytest.mark.parametrize("level", ["x86-64-v9", "native", "haswell"])
def test_unknown_instruction_level_is_rejected(level):
    words = "-m forcefit assembly solve five_bar --quantities margin"
    status, out, err = run(level, *words.split())
    assert (status, out) == (2, "")
    assert err == (
        f'forcefit: FORCEFIT_MARCH is "{level}"; expected a level that this processor '
        f"has, {', '.join(levels_here())}\n"
    )


def test_instruction_level_above_that_of_the_processor_is_rejected(monkeypatch):
    monkeypatch.setattr(choice.platform, "machine", lambda: "x86_64")
    monkeypatch.setattr(choice, "_load", lambda _: SimpleNamespace(level=lambda: 3))
    monkeypatch.setenv("FORCEFIT_MARCH", "x86-64-v4")
    with pytest.raises(BadInput, match=r'is "x86-64-v4"; .* x86-64-v2, x86-64-v3$'):
        chosen()


def test_unsupported_processor_raises_an_import_error(monkeypatch):
    monkeypatch.delenv("FORCEFIT_MARCH", raising=False)
    monkeypatch.setattr(choice.platform, "machine", lambda: "x86_64")
    monkeypatch.setattr(choice, "_load", lambda _: SimpleNamespace(level=lambda: 1))
    with pytest.raises(ImportError, match=r"x86-64-v2$"):
        chosen()


def test_portable_module_is_loaded_on_other_architectures(monkeypatch):
    monkeypatch.setattr(choice.platform, "machine", lambda: "aarch64")
    monkeypatch.setattr(choice, "_load", lambda name: name)
    monkeypatch.delenv("FORCEFIT_MARCH", raising=False)
    assert chosen() == "_portable"
    monkeypatch.setenv("FORCEFIT_MARCH", "x86-64-v3")
    with pytest.raises(BadInput, match=r"but it has no such levels$"):
        chosen()


def test_missing_module_raises_an_import_error(monkeypatch):
    monkeypatch.setattr(choice, "find_spec", lambda _: None)
    with pytest.raises(
        ImportError, match=r"^forcefit.assembly.kernels.\w+ is not built: run `"
    ):
        chosen()


def test_compiled_module_was_built_from_the_current_sources():
    """The module is built by `make`."""
    folder, listed = ROOT / "assembly" / "kernels", ""
    for path in sorted(folder.rglob("*.*"), key=Path.as_posix):
        if path.suffix in {".cpp", ".h"}:
            text = path.read_bytes().replace(b"\r\n", b"\n")
            own = hashlib.sha256(text).hexdigest()
            listed += f"{path.relative_to(folder).as_posix()} {own}\n"
    assert kernels.sources == hashlib.sha256(listed.encode()).hexdigest()
