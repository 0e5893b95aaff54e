"""Wrenches as tables of aligned columns, in SI units."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assembly.linear.assembled import without_rounding
from stiffness.screws import WRENCH


def wrench_lines(frames: Mapping[str, Any], closures: Sequence[Any]) -> list[str]:
    """Wrenches through all frames and closures for people.

    Args:
        frames: by name, of :func:`assembly.report.results.solution_of`.
        closures: likewise.

    Returns:
        Lines of one table for each.
    """
    rows = {name: frame["wrench"] for name, frame in frames.items()}
    starts = {name: frame["start_wrench"] for name, frame in frames.items()
              if "start_wrench" in frame}  # fmt: skip
    shut = {" - ".join(pair["frames"]): pair["wrench"] for pair in closures}
    width = max(map(len, (*rows, *shut, "closure")))
    units = [f"{name} [{'N m' if name[0] == 'M' else 'N'}]" for name in WRENCH]

    def table(head: str, wrenches: dict[str, NDArray]) -> list[str]:
        lines = [f"{head:{width}s}" + "".join(f"{unit:>13s}" for unit in units)]
        shown = without_rounding(np.reshape(list(wrenches.values()), (-1, 6)))
        for name, wrench in zip(wrenches, shown.tolist(), strict=True):
            lines.append(f"{name:{width}s}" + "".join(f"{w:13.5g}" for w in wrench))
        return lines

    lines = ["", "wrenches through the bodies, at each frame's origin in its axes"]
    lines += table("frame", rows)
    if starts:
        lines += ["", "the same where links under their own weight start"]
        lines += table("frame", starts)
    if shut:
        lines += ["", "wrenches of the closures, at the platform's origin, base axes"]
        lines += table("closure", shut)
    return lines
