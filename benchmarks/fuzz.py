"""Run commands with random invalid input, and count failures.

Run ``python benchmarks/fuzz.py [COUNT] [--seed N] [--every-option]`` in the root of the
repository.  Each input is a valid command of ``fuzz_seeds.py``, ``fuzz_foreign.py`` or
``fuzz_machines.py``, whose files or arguments are changed by ``fuzz_mutations.py``.
The command runs in a fork of this process.  ``fuzz_faults.py`` checks the result.  The
seed and the number of an input determine the input, and ``--only I`` runs only the
input with the number I.  With ``--every-option``, each option of each command is tested
with each value of EXTREMES.

The requirements on each command are:

- The exit status is 0, 1, 2 or 130.
- With status 2, stderr contains one line that starts with ``forcefit: ``, and no new
  file exists.  Otherwise, stderr contains only progress.
- All files are complete, existing files are unchanged, and no temporary files remain.

A command that takes more than LIMIT of processor time is interrupted as by Ctrl-C.
"""

import argparse
import os
import pickle
import re
import resource
import shlex
import shutil
import signal
import struct
import sys
import tempfile
import time
import traceback
from collections import Counter
from pathlib import Path
from random import Random
from typing import NamedTuple

from forcefit.commands import app as forcefit_command

os.environ["OPENBLAS_NUM_THREADS"] = "1"  # must be set before numpy is imported
sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parent.parent)]

import typer  # noqa: E402
from fuzz_faults import faults  # noqa: E402
from fuzz_foreign import FOREIGN, MADE_FOREIGN, write_foreign  # noqa: E402
from fuzz_machines import MACHINES, MADE_MACHINES, STEP, write_machines  # noqa: E402
from fuzz_mutations import change_file, change_words  # noqa: E402
from fuzz_seeds import COMMANDS, KILLED, MADE, write_seeds  # noqa: E402

LIMIT = 2.0  # [s] processor time after which a command receives Ctrl-C
PATIENCE = 60.0  # [s] time after which a command is killed
BATCH = 50  # number of inputs for each process
MEMORY = 8 << 30  # [byte] limit of the address space of a process
EXTREMES = [
    "nan", "inf", "-inf", "0", "-1", "1e300", "-1e300", "1e-300", "1e15", "9" * 400, "",
]  # fmt: skip
_HEAD = struct.Struct("<Q")


class Asked(NamedTuple):
    """Settings of a run."""

    seed: int
    options: dict[str, list[tuple[str, bool]]]
    commands: list[tuple[int, str]]
    fixed: list[list[str]]  # arguments of all inputs with --every-option


def options_of() -> dict[str, list[tuple[str, bool]]]:
    """Return the options of each command, and whether they require a value."""
    faults = {}

    def walk(command, path):
        for name, inner in getattr(command, "commands", {}).items():
            walk(inner, (*path, name))
        if not hasattr(command, "commands"):
            faults[" ".join(path)] = [
                (p.opts[0], not getattr(p, "is_flag", False))
                for p in command.params
                if p.param_type_name == "option"
            ]

    walk(typer.main.get_command(forcefit_command.app), ())
    return faults


def every_option(asked: Asked) -> list[list[str]]:
    """Return commands with an additional option, for each option and each value."""
    sound: dict[str, list[str]] = {}
    for _, command in asked.commands:
        words = shlex.split(command)
        sound.setdefault(command_name(words), words)
    return [
        [*sound[name], option, value]
        for name in sorted(asked.options.keys() & sound.keys())
        for option, takes_value in asked.options[name]
        if takes_value
        for value in EXTREMES
    ]


def command_name(words: list[str]) -> str:
    """Return the words that name a command."""
    if words[0] in {"study", "convert"}:
        return words[0]
    return " ".join(words[:2])


def prepare(folder: Path, commands: list[str]) -> None:
    """Write valid files, and run each valid command once."""
    write_seeds(folder)
    write_foreign(folder)
    write_machines(folder)
    os.chdir(folder)
    for command in [*MADE, *MADE_FOREIGN, *MADE_MACHINES]:
        status, _, err = run(shlex.split(command))
        assert status == 0, f"{command}: {status}\n{err}"
    for command in KILLED:
        child = os.fork()
        if not child:
            import forcefit.assembly.statistics.monte_carlo
            import forcefit.assembly.sweeps.sweep

            forcefit.assembly.sweeps.sweep.write_sweep = lambda *_: os._exit(0)
            forcefit.assembly.statistics.monte_carlo.save_dataset = lambda *_: os._exit(
                0
            )
            run(shlex.split(command))
            os._exit(1)
        assert os.waitpid(child, 0)[1] == 0, command
    assert {p.name for p in folder.glob("*.journal")} == {
        "kept.nc.journal", "drawn.nc.journal"
    }  # fmt: skip
    for name in ("notes.json", "notes.png", "notes.nc"):
        shutil.copy(folder / "notes.txt", folder / name)
    for command in commands:
        with tempfile.TemporaryDirectory() as other:
            shutil.copytree(folder, other, dirs_exist_ok=True)
            os.chdir(other)
            began = time.process_time()
            status, _, err = run(shlex.split(command))
            took = time.process_time() - began
            if took > 0.5:
                print(f"{took:6.1f} s  {command[:90]}", flush=True)
            # commands with an invalid argument stop early, which saves time
            if status not in {0, 1} and ",x" not in command and "solid" not in command:
                print(f"unexpected exit status {status}: {command}\n   {err[-300:]}")
    os.chdir(folder)


def run(words: list[str]) -> tuple[object, str, str]:
    """Run a command in this process; return exit status, stdout and stderr."""
    saved = [os.dup(1), os.dup(2)]
    files = [tempfile.TemporaryFile(), tempfile.TemporaryFile()]
    sys.stdout.flush()
    for number, file in enumerate(files, 1):
        os.dup2(file.fileno(), number)
    before = sys.argv, sys.stdout, sys.stderr
    sys.stdout = os.fdopen(os.dup(1), "w", encoding="utf-8")
    sys.stderr = os.fdopen(
        os.dup(2), "w", encoding="utf-8", errors="backslashreplace", buffering=1
    )
    sys.argv = ["forcefit", *words]
    sys.warnoptions[:] = ["default"]  # warnings are failures
    try:
        forcefit_command.main()
        status: object = 0
    except SystemExit as done:
        status = done.code
    except BaseException:
        traceback.print_exc()
        status = "traceback"
    try:
        sys.stdout.flush()
        sys.stderr.flush()
    finally:
        written = sys.stdout, sys.stderr
        sys.argv, sys.stdout, sys.stderr = before
        for stream in written:
            stream.close()
        for number, copy in enumerate(saved, 1):
            os.dup2(copy, number)
            os.close(copy)
    messages = []
    for file in files:
        file.seek(0)
        messages.append(file.read().decode("utf-8", errors="replace"))
        file.close()
    return status, *messages


def changed(number: int, asked: Asked) -> tuple[list[str], list[str]]:
    """Return the arguments of an input, after changing files in the current folder."""
    if asked.fixed:
        return asked.fixed[number], ["an option"]
    random = Random(f"{asked.seed}:{number}")
    weights, commands = zip(*asked.commands, strict=True)
    words = shlex.split(random.choices(commands, weights)[0])
    files = [Path(word.partition("#")[0]) for word in words]
    files = [path for path in files if path.exists()]
    files += [Path(f"{word}.journal") for word in words]
    files += [path.with_suffix(".yaml") for path in files if path.suffix == ".urdf"]
    files += [path.with_suffix(".npz") for path in files if path.name == "saved.toml"]
    inside = [p for path in files if path.is_dir() for p in sorted(path.iterdir())]
    files = [path for path in [*files, *inside] if path.is_file()]
    if "study" in words[0] or "arm.toml" in words:
        files += (
            [Path("bar.toml")]
            if words[0] == "study"
            else sorted(Path("links").iterdir())
        )
    done = []
    if files and random.random() < 0.6:
        path = random.choice(files)
        done.append(f"{path}: {change_file(path, random)}")
    if not done or random.random() < 0.1:
        options = asked.options.get(command_name(words), [])
        words = change_words(words, options, random)
        done.append("words")
    return words, done


def snapshot() -> dict[str, bytes]:
    """Return the contents of all files in the current folder by name."""
    return {
        str(p) if p.is_file() else f"{p}/": p.read_bytes() if p.is_file() else b""
        for p in sorted(Path().rglob("*"))
        if p.is_file() or not any(p.iterdir())
    }


def one(number: int, asked: Asked, seeds: Path) -> dict:
    """Run an input and return the faults of its result."""
    place = Path(tempfile.mkdtemp(dir=f"{seeds}.inputs"))
    folder_of_run, temporary = place / "here", place / "tmp"
    shutil.copytree(seeds, folder_of_run)
    (folder_of_run / "empty").mkdir()
    temporary.mkdir()
    os.chdir(folder_of_run)
    words, done = changed(number, asked)
    before = snapshot()
    stopped: list[bool] = []

    def stop(*_):
        stopped.append(True)
        signal.raise_signal(signal.SIGINT)

    signal.signal(signal.SIGPROF, stop)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.setitimer(signal.ITIMER_PROF, LIMIT, LIMIT)
    tempfile.tempdir = None
    os.environ["TMPDIR"] = str(temporary)
    began = time.process_time()
    try:
        status, out, err = run(words)
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
    took = time.process_time() - began
    after = snapshot()
    left = [str(p.name) for p in temporary.iterdir()]
    os.chdir("/")
    shutil.rmtree(place)
    wrong = faults(words, status, out, err, before, after, left)
    if status == 130 and not stopped:
        wrong.append("130 without Ctrl-C")
    return {"words": words, "done": done, "status": status, "err": err, "out": out,
            "stopped": bool(stopped), "took": took, "wrong": wrong}  # fmt: skip


def tell(numbers: list[int], asked: Asked, seeds: Path, say: int) -> None:
    """Run inputs in a child process, and write the results to a pipe."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    with os.fdopen(say, "wb") as file:
        for number in numbers:
            content = pickle.dumps(one(number, asked, seeds))
            file.write(_HEAD.pack(len(content)) + content)
            file.flush()


def batch(numbers: list[int], asked: Asked, seeds: Path) -> list:
    """Run inputs in forked processes."""
    results = []
    while numbers:
        listen, say = os.pipe()
        child = os.fork()
        if not child:
            try:
                tell(numbers, asked, seeds, say)
                os._exit(0)
            except BaseException:
                traceback.print_exc()
            finally:
                os._exit(1)
        os.close(say)
        with os.fdopen(listen, "rb") as file:
            while numbers:
                signal.alarm(int(PATIENCE))
                try:
                    head = file.read(_HEAD.size)
                except TimeoutError:
                    head = b""
                signal.alarm(0)
                if len(head) < _HEAD.size:
                    break
                faults = pickle.loads(file.read(_HEAD.unpack(head)[0]))
                results.append((numbers.pop(0), faults))
        if numbers:
            os.kill(child, signal.SIGKILL)
        _, status = os.waitpid(child, 0)
        if numbers:
            died = os.WTERMSIG(status) if os.WIFSIGNALED(status) else status
            what = "hangs" if died == signal.SIGKILL else f"dies of signal {died}"
            faults = {"words": [], "done": [], "status": what, "err": "", "out": "",
                     "stopped": False, "took": PATIENCE, "wrong": [what]}  # fmt: skip
            results.append((numbers.pop(0), faults))
    return results


def main() -> int:
    """Run the inputs, print the counts, and return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("count", nargs="?", type=int, default=3000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", type=int, nargs="+")
    parser.add_argument(
        "--every-option",
        action="store_true",
        help="test each option with each extreme value",
    )
    given = parser.parse_args()

    def too_late(*_):
        raise TimeoutError

    signal.signal(signal.SIGALRM, too_late)
    counts, wrong, slow = Counter(), {}, []
    with tempfile.TemporaryDirectory() as folder:
        seeds = Path(folder)
        os.environ["FORCEFIT_CACHE"] = f"{folder}.cache"
        Path(f"{folder}.inputs").mkdir()
        os.environ.pop("DISPLAY", None)
        commands = [*COMMANDS, *FOREIGN, *MACHINES, *STEP]
        prepare(seeds, [] if given.only else [command for _, command in commands])
        asked = Asked(given.seed, options_of(), commands, [])
        if given.every_option:
            asked = asked._replace(fixed=every_option(asked))
            given.count = len(asked.fixed)
        if given.only is not None:
            for number, faults in batch(given.only, asked, seeds):
                print(number, shlex.join(faults["words"]), faults["done"], sep="\n")
                print(faults["out"][-2000:], faults["err"], sep="\n")
                print(faults["status"], faults["wrong"])
            return 0
        began = time.monotonic()
        for first in range(0, given.count, BATCH):
            numbers = list(range(first, min(first + BATCH, given.count)))
            for number, faults in batch(numbers, asked, seeds):
                counts["inputs"] += 1
                counts[f"exit status {faults['status']}"] += 1
                counts["stopped by Ctrl-C"] += faults["stopped"]
                slow.append((faults["took"], number, shlex.join(faults["words"])[:100]))
                for fault in faults["wrong"]:
                    kind = re.sub(r"[\d.]{4,}|0x\w+", "#", fault)
                    wrong.setdefault(kind, []).append(number)
        os.chdir("/")
    for name in ("cache", "inputs"):
        shutil.rmtree(f"{folder}.{name}", ignore_errors=True)
    used = sum(resource.getrusage(r).ru_utime + resource.getrusage(r).ru_stime
               for r in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))  # fmt: skip
    for name, count in sorted(counts.items()):
        print(f"{name:24s} {count}")
    print(f"{'processor time':24s} {used:.0f} s, {time.monotonic() - began:.0f} s wall")
    for took, number, messages in sorted(slow, reverse=True)[:8]:
        print(f"  {took:5.1f} s  {number}: {messages}")
    print(f"{'faults':24s} {sum(map(len, wrong.values()))} of {len(wrong)} kinds")
    for kind, numbers in sorted(wrong.items(), key=lambda item: -len(item[1])):
        print(f"  {len(numbers):4d}  {kind}   [--only {numbers[0]}]")
    return bool(wrong)


if __name__ == "__main__":
    sys.exit(main())
