"""What is learned from readings that follow one another: a printer that warms up.

    python -m benchmarks.diagnosis_spans [COUNT] [--first SEED]

Campaign k, drawn from seed k: a frame 530 mm high with another expansion than declared
and a bed that moves the nozzle, by its temperature, by its temperature of before (lag)
or by the chamber's; two to three steps of heating, 700 rows in four hours; white noise
of 2 um, and noise correlated over ten minutes, 0 to 3 um, which sigma does not say.
Printed: what was learned, and on spans of time kept aside the error, the noise that is
in them, and the ratio.
"""

import argparse
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from assembly.files.robot_file import write_robot
from assembly.model.robot import Frame, Robot
from validation.campaign.campaign_file import read_campaign
from validation.diagnosis.diagnose import diagnose

ROWS, STEP, HEIGHT, SIGMA = 700, 20.0, 0.53, 2e-6
CAMPAIGN = f"""robot = "robot.toml"
measurements = "rows.csv"
registration = "known"
[noise]
rotation = 1.0
position = {SIGMA}
"""


def lagged(x: NDArray, time_constant: float) -> NDArray:
    """What follows x with a delay of first order."""
    part = 1 - np.exp(-STEP / time_constant)
    y, last = np.empty_like(x), x[0]
    for i, value in enumerate(x):
        last += part * (value - last)
        y[i] = last
    return y


def warm_up(seed: int) -> tuple[dict[str, NDArray], NDArray, NDArray]:
    """Columns of the rows, readings [m], and the noise in them."""
    rng = np.random.default_rng(seed)
    time = STEP * np.arange(ROWS)
    steps = rng.integers(2, 4)
    begins = np.sort(rng.uniform(0, 0.8 * time[-1], steps))
    levels = rng.choice([0, 40, 60, 80], steps)
    begins[0], levels[0] = 200.0, rng.choice([60, 80])
    asked = np.zeros(ROWS)
    for begin, level in zip(begins, levels, strict=True):
        asked[time >= begin] = level
    bed = lagged(asked, 300.0) + 0.05 * rng.normal(size=ROWS)
    chamber = lagged(0.3 * bed, 2500.0) + 0.05 * rng.normal(size=ROWS)
    frame = lagged(0.5 * chamber, 1500.0) + 0.03 * rng.normal(size=ROWS)
    true = -HEIGHT * rng.uniform(1e-5, 5e-5) * frame
    gain = rng.uniform(-2e-6, 2e-6)
    true += (gain * bed, gain * lagged(bed, 800.0), 3 * gain * chamber)[seed % 3]
    slow, size, last = np.empty(ROWS), rng.uniform(0, 3e-6), 0.0
    kept = np.exp(-STEP / 600.0)
    for i in range(ROWS):
        last = kept * last + size * np.sqrt(1 - kept**2) * rng.normal()
        slow[i] = last
    noise = slow + SIGMA * rng.normal(size=ROWS)
    columns = {
        "temperature": frame, "time": time, "bed_temperature": bed,
        "chamber_temperature": chamber,
    }  # fmt: skip
    return columns, true + noise, noise


def run_case(seed: int) -> float:
    """Error over noise on the rows kept aside."""
    columns, read, noise = warm_up(seed)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        frames = (
            Frame("frame", translation=[0, 0, HEIGHT]),
            Frame("z", "frame", joint="prismatic", actuated=True),
            Frame("nozzle", "z"),
        )
        write_robot(Robot("printer", "nozzle", frames), folder / "robot.toml")
        (folder / "campaign.toml").write_text(CAMPAIGN)
        head = ",".join(["id", "q.z", "meas.tz", *(f"cov.{c}" for c in columns)])
        rows = np.column_stack([np.zeros(ROWS), read, *columns.values()])
        lines = [f"m{i}," + ",".join(f"{x:.9g}" for x in r) for i, r in enumerate(rows)]
        (folder / "rows.csv").write_text("\n".join([head, *lines]) + "\n")
        answer = diagnose(read_campaign(folder))
    kept = ~answer.split.fitted
    left = float(np.sqrt(np.mean(noise[kept] ** 2)))
    ratio = answer.after.position / left
    learned = [
        f"{one.candidate.parts[0].variable} {one.candidate.shape.form}"
        f"({len(one.candidate.shape.names)})"
        for one in answer.model.learned
    ]
    effects = ", ".join(answer.best_by_score) or "nothing"
    error = f"{1e6 * answer.after.position:.2f} over {1e6 * left:.2f} um, {ratio:.2f}"
    print(f"{seed}: {answer.verdict}, {effects}; learned "
          f"{', '.join(learned) or 'nothing'}; {error}", flush=True)  # fmt: skip
    return ratio


def main() -> None:
    """Print every case, then quantiles."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("count", nargs="?", type=int, default=30)
    parser.add_argument("--first", type=int, default=0)
    given = parser.parse_args()
    some = range(given.first, given.first + given.count)
    ratios = np.array([run_case(seed) for seed in some])
    print(f"{len(ratios)} campaigns: median {np.median(ratios):.2f}, "
          f"90 % {np.quantile(ratios, 0.9):.2f}, largest {ratios.max():.2f}, "
          f"{np.mean(ratios <= 1.2):.0%} within 1.2")  # fmt: skip


if __name__ == "__main__":
    main()
