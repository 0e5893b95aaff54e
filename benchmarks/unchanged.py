"""Store the results of commands, and compare them after a change of the code.

    python benchmarks/unchanged.py store FOLDER     # before the change
    python benchmarks/unchanged.py compare FOLDER   # after the change

The built-in robots with random errors are written as robot files.  For each robot, the
program runs ``solve`` with margins and the exact state, and ``error``.  It also runs a
sweep, statistics, a diagnosis, a cross-check, and K_E by finite elements and by beams.
If numbers differ, the largest relative difference is printed.  Times, versions and
round-off in certificates are not compared.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).parents[1]
ROBOTS = ("irsbot2", "four_bar", "five_bar", "3rrr", "hexapod", "delta", "orthoglide")
# keys whose values differ between identical runs
PASSING = ("seconds", "time", "version", "sha256", "created", "path", "file", "output")
# keys of certificates, whose values are round-off
CERTIFICATES = ("certificate", "residual", "gap", "excess", "linearisation_error")
SMALLEST = 1e-9  # [SI unit] threshold of round-off


def questions(folder: Path) -> dict[str, list[str]]:
    """Return the arguments of each command, with ``{out}`` for its output file."""
    asked = {
        f"{question} {robot}": ["assembly", *words, str(folder / f"{robot}.toml")]
        for robot in (*ROBOTS, "arm6")
        for question, words in {
            "solve": ["solve"],
            "error": ["error"],
            "zone": ["solve", "--quantities", "margin"],
            "exact": ["solve", "--state", "exact"],
        }.items()
    }
    irsbot2 = str(folder / "irsbot2.toml")
    asked["loaded"] = [
        "assembly",
        "solve",
        irsbot2,
        "--load",
        "fz=-50",
        "--gravity",
        "z=-9.81",
    ]
    errors = str(ROOT / "examples" / "irsbot2_errors.toml")
    grid = "tx=-0.2:0.2:0.1,tz=-0.5"
    asked["sweep"] = ["assembly", "sweep", irsbot2, "--grid", grid, "-o", "{out}.nc"]
    asked["statistics"] = [
        "assembly", "statistics", "irsbot2", "--errors", errors, "--draws", "200",
        "--limit", "energy=5",
    ]  # fmt: skip
    campaign = str(ROOT / "tests" / "campaigns" / "self_weight")
    asked["diagnosis"] = ["validation", "diagnose", campaign]
    asked["cross-check"] = [
        "validation", "crosscheck", "irsbot2", "--errors", errors,
        "--pose", "tx=0,tz=-0.5", "--scale", "1,0.5,0.25",
    ]  # fmt: skip
    material = ["--young", "6e10", "--poisson", "0.3"]
    asked["K_E of a mesh"] = [
        "stiffness", "fea", str(ROOT / "meshes" / "distal_plain.stl"),
        "--base", "z=0", "--tip", "z=0.452", *material,
    ]  # fmt: skip
    beam = ["--length", "0.452", "--radius", "0.04"]
    asked["K_E of a beam"] = ["stiffness", "beam", *beam, *material]
    return asked


def write_robots(folder: Path) -> None:
    """Write a robot file with random errors for each built-in robot."""
    from forcefit.assembly.files.robot_file import write_robot
    from forcefit.assembly.robots import load_robot

    folder.mkdir(parents=True, exist_ok=True)
    for name in (*ROBOTS, "arm6"):
        if (folder / f"{name}.toml").exists():
            continue  # the file of the previous version is used
        robot = load_robot(name)
        rng = np.random.default_rng(sum(map(ord, name)))
        scales = [1e-3, 1e-3, 1e-3, 5e-4, 5e-4, 5e-4]
        errors = rng.uniform(-1, 1, (len(robot.frames), 6)) * scales
        if name == "irsbot2":  # the loops cannot be closed with errors of rigid bodies
            errors[[frame.link is None for frame in robot.frames]] = 0.0
        write_robot(robot.with_errors(errors), folder / f"{name}.toml")


def answer(words: list[str]) -> Any:
    """Return the exit status, the JSON output and the data set of a command."""
    with tempfile.TemporaryDirectory() as scratch:
        out = str(Path(scratch) / "out")
        words = [word.replace("{out}", out) for word in words]
        command = [sys.executable, "-m", "forcefit", *words, "--json", f"{out}.json"]
        ran = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
        results: dict[str, Any] = {"status": ran.returncode}
        if Path(f"{out}.json").exists():
            results["json"] = json.loads(Path(f"{out}.json").read_text())
        else:
            results["message"] = ran.stderr.strip().splitlines()[-1:]
        if Path(f"{out}.nc").exists():
            import xarray as xr

            with xr.open_dataset(f"{out}.nc", engine="h5netcdf") as dataset:
                for name, array in dataset.load().data_vars.items():
                    if array.dtype.kind in "fi":
                        results[f"nc {name}"] = array.values.tolist()
        return results


def leaves(value: Any, place: str = "") -> dict[str, Any]:
    """Yield the numbers, texts and booleans of a result with their keys."""
    if isinstance(value, dict):
        left_out = (*PASSING, *CERTIFICATES)
        kept = {k: v for k, v in value.items() if not any(p in k for p in left_out)}
        return {
            k: v
            for key, one in kept.items()
            for k, v in leaves(one, f"{place}/{key}").items()
        }
    if isinstance(value, list):
        return {
            k: v
            for i, one in enumerate(value)
            for k, v in leaves(one, f"{place}/{i}").items()
        }
    return {place: value}


def difference(was: Any, now: Any) -> tuple[float, list[str]]:
    """Return the largest relative difference of numbers, and all other differences."""
    before, after = leaves(was), leaves(now)
    gap, other = 0.0, sorted(before.keys() ^ after.keys())
    sizes: dict[str, float] = {}
    for place, one in before.items():
        if isinstance(one, float) and np.isfinite(one):
            array = "/".join(p for p in place.split("/") if not p.isdigit())
            sizes[array] = max(sizes.get(array, 0.0), abs(one))
    for place in before.keys() & after.keys():
        one, two = before[place], after[place]
        if one == two or (one != one and two != two):
            continue
        if isinstance(one, float | int) and isinstance(two, float | int):
            array = "/".join(p for p in place.split("/") if not p.isdigit())
            gap = max(gap, abs(one - two) / max(sizes.get(array, 0.0), SMALLEST))
        else:
            other.append(f"{place}: {one} -> {two}")
    return gap, other


def main() -> None:
    """Store or compare results, and return 1 if differences exceed round-off."""
    what, folder = sys.argv[1], Path(sys.argv[2]).resolve()
    if what == "store":
        write_robots(folder)
        stored = {name: answer(words) for name, words in questions(folder).items()}
        (folder / "answers.json").write_text(json.dumps(stored))
        print(f"{len(stored)} results in {folder}")
        return
    stored = json.loads((folder / "answers.json").read_text())
    worst = 0
    for name, words in questions(folder).items():
        # values are compared in the form in which JSON stores NaN and infinity
        now = json.loads(json.dumps(answer(words)))
        gap, other = difference(stored[name], now)
        count = len(leaves(stored[name]))
        told = "the same" if not gap and not other else f"differs by {gap:.1e}"
        print(f"{name:24} {count:6} values  {told}")
        for line in other[:5]:
            print(f"    {line[:120]}")
        worst |= gap > 1e-9 or bool(other)
    sys.exit(worst)


if __name__ == "__main__":
    main()
