"""Choice of the compiled module, and results that do not depend on it."""

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
# x86-64 psABI, table 3.1, in Linux's words: what each level adds
FLAGS = {
    "x86-64-v2": "cx16 lahf_lm popcnt pni ssse3 sse4_1 sse4_2",
    "x86-64-v3": "avx avx2 bmi1 bmi2 f16c fma abm movbe",
    "x86-64-v4": "avx512f avx512bw avx512cd avx512dq avx512vl",
}
x86_64 = pytest.mark.skipif(not levels_here(), reason="no levels elsewhere")


def run(level, *words):
    """A fresh Python's exit status and both of its outputs."""
    given = os.environ | {"FORCEFIT_MARCH": level, "PYTHONPATH": str(ROOT)}
    done = subprocess.run([sys.executable, *map(str, words)], env=given, text=True,
                          capture_output=True, cwd=ROOT, check=False)  # fmt: skip
    return done.returncode, done.stdout, done.stderr


@cache
def digests(level):
    """Name of the module used, and digests of its answers by their names."""
    status, out, err = run(level, PROGRAM)
    assert status == 0, err
    first, *rows = out.splitlines()
    return first.split("\t"), dict(row.split("\t") for row in rows)


@x86_64
@pytest.mark.parametrize("level", LEVELS)
def test_every_instruction_level_gives_bit_identical_results(level):
    """Products and sums are rounded one by one, in the same order on every processor.

    Energies with loads and without, margins, pose errors, compliances, draws and where
    clearances then are, tracks and cones, of more points than there are lanes; one
    point takes two lanes.
    """
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
def test_available_instruction_levels_follow_from_the_processor_flags():
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
def test_unknown_instruction_level_is_refused_in_one_line(level):
    words = "-m forcefit assembly solve five_bar --quantities margin"
    status, out, err = run(level, *words.split())
    assert (status, out) == (2, "")
    assert err == (
        f'forcefit: FORCEFIT_MARCH is "{level}"; expected a level that this processor '
        f"has, {', '.join(levels_here())}\n"
    )


def test_instruction_level_above_that_of_the_processor_is_refused(monkeypatch):
    monkeypatch.setattr(choice.platform, "machine", lambda: "x86_64")
    monkeypatch.setattr(choice, "_load", lambda _: SimpleNamespace(level=lambda: 3))
    monkeypatch.setenv("FORCEFIT_MARCH", "x86-64-v4")
    with pytest.raises(BadInput, match=r'is "x86-64-v4"; .* x86-64-v2, x86-64-v3$'):
        chosen()


def test_processor_below_every_instruction_level_raises_an_import_error(monkeypatch):
    monkeypatch.delenv("FORCEFIT_MARCH", raising=False)
    monkeypatch.setattr(choice.platform, "machine", lambda: "x86_64")
    monkeypatch.setattr(choice, "_load", lambda _: SimpleNamespace(level=lambda: 1))
    with pytest.raises(ImportError, match=r"x86-64-v2$"):
        chosen()


def test_portable_module_is_loaded_on_another_architecture(monkeypatch):
    monkeypatch.setattr(choice.platform, "machine", lambda: "aarch64")
    monkeypatch.setattr(choice, "_load", lambda name: name)
    monkeypatch.delenv("FORCEFIT_MARCH", raising=False)
    assert chosen() == "_portable"
    monkeypatch.setenv("FORCEFIT_MARCH", "x86-64-v3")
    with pytest.raises(BadInput, match=r"but it has no such levels$"):
        chosen()


def test_missing_module_raises_an_import_error_with_the_remedy(monkeypatch):
    monkeypatch.setattr(choice, "find_spec", lambda _: None)
    with pytest.raises(
        ImportError, match=r"^forcefit.assembly.kernels.\w+ is not built: run `"
    ):
        chosen()


def test_compiled_module_was_built_from_the_current_sources():
    """An outdated module would be tested in place of the sources; `make` builds it."""
    folder, listed = ROOT / "assembly" / "kernels", ""
    for path in sorted(folder.rglob("*.*"), key=Path.as_posix):
        if path.suffix in {".cpp", ".h"}:
            text = path.read_bytes().replace(b"\r\n", b"\n")
            own = hashlib.sha256(text).hexdigest()
            listed += f"{path.relative_to(folder).as_posix()} {own}\n"
    assert kernels.sources == hashlib.sha256(listed.encode()).hexdigest()
