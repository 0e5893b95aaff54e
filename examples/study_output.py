"""What the studies of measured data share: options, tables, results."""

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from forcefit.inputs.table import BadInput
from forcefit.inputs.writing import write_json


def arguments(doc: str | None, output: str) -> argparse.Namespace:
    """Options of a study: ``data`` and ``output``, both paths; the latter is made.

    Args:
        doc: docstring of the study.
        output: folder written to unless another is given.

    Returns:
        The options.
    """
    parser = argparse.ArgumentParser(description=(doc or "").split("\n")[0])
    parser.add_argument("--data", type=Path, help="folder that holds the data sets")
    parser.add_argument("-o", "--output", type=Path, default=Path(output))
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    return options


def run(study: Callable[[], None]) -> None:
    """Run a study; without its data it says so and exits with 2.

    Args:
        study: to be run.
    """
    try:
        study()
    except BadInput as error:
        print(error, file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt:
        sys.exit(130)


def rms_position(residuals: NDArray) -> float:
    """[m] rms length of the translations of (k, 6) residuals."""
    return float(np.sqrt(np.mean(np.sum(residuals[:, 3:] ** 2, axis=1))))


def rms_rotation(residuals: NDArray) -> float:
    """[rad] rms angle of the rotations of (k, 6) residuals."""
    return float(np.sqrt(np.mean(np.sum(residuals[:, :3] ** 2, axis=1))))


def print_table(title: str, header: Sequence[str], rows: Sequence[Sequence]) -> None:
    """Print numbers with three decimals below a title."""
    text = [[x if isinstance(x, str) else f"{x:.3f}" for x in row] for row in rows]
    text = [["" if x == "nan" else x for x in row] for row in text]
    wide = [max(len(line[i]) for line in [header, *text]) for i in range(len(header))]
    print(f"\n{title}")
    for line in [header, *text]:
        first = line[0].ljust(wide[0])
        rest = (x.rjust(w) for x, w in zip(line[1:], wide[1:], strict=True))
        print("  ".join(["", first, *rest]))


def write_results(folder: Path, results: dict) -> None:
    """Write ``results.json``, in SI."""
    write_json(results, str(folder / "results.json"))
