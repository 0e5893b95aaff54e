"""Measure the start-up time of commands, relative to the import of numpy and scipy.

Run ``python benchmarks/startup.py [RUNS]``.  The processor time of each command is
divided by the processor time of ``import numpy, scipy.linalg``.  The table contains
medians of RUNS runs (7 by default).  The commands are run alternately.  The exit status
is 1 if a ratio exceeds its limit.
"""

import os
import statistics
import subprocess
import sys

BASE = ["-c", "import numpy, scipy.linalg"]
AT = ["irsbot2", "--pose", "tx=0.1,tz=-0.5"]
WANTED = {  # largest allowed ratio of each command
    "--help": 2.5,
    "--version": 2.5,
    "assembly solve": 5.0,
    "assembly solve --quantities margin": 5.0,
    "assembly error": 5.0,
}


def processor_time(arguments):
    """Return the processor time [s] of Python with given arguments."""
    child = subprocess.Popen([sys.executable, *arguments], stdout=subprocess.DEVNULL)
    _, status, used = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode:
        raise SystemExit(f"{arguments}: exit status {child.returncode}")
    return used.ru_utime + used.ru_stime


def main(runs=7):
    """Run all commands, print the table, and return whether all limits are met."""
    commands = {"import numpy, scipy.linalg": BASE}
    for words in WANTED:
        place = AT if words.startswith("assembly") else []
        commands[f"forcefit {words}"] = ["-m", "forcefit", *words.split(), *place]
    for arguments in commands.values():
        processor_time(arguments)
    times = {name: [] for name in commands}
    for _ in range(runs):
        for name, arguments in commands.items():
            times[name].append(processor_time(arguments))
    medians = {name: statistics.median(seconds) for name, seconds in times.items()}
    base, *_ = medians.values()
    print(f"{'':28} processor s   ratio    limit")
    for (name, median), wanted in zip(
        medians.items(), [1.0, *WANTED.values()], strict=True
    ):
        print(f"{name:28} {median:11.3f} {median / base:7.2f} {wanted:8.1f}")
    ratios = [median / base for median in medians.values()][1:]
    return int(any(r > w for r, w in zip(ratios, WANTED.values(), strict=True)))


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:])))
