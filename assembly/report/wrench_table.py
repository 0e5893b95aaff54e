"""Wrenches as tables of aligned columns, in SI units."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from forcefit.assembly.linear.assembled import without_rounding
from forcefit.results.text import table_lines
from forcefit.stiffness.screws import WRENCH

_HEAD = tuple(f"{name} [{'N m' if name[0] == 'M' else 'N'}]" for name in WRENCH)


def wrench_lines(frames: Mapping[str, Any], closures: Sequence[Any]) -> list[str]:
    """Return the wrenches through all frames and closures as text.

    Args:
        frames: wrenches by frame, from
            :func:`forcefit.assembly.report.results.solution_of`.
        closures: wrenches of the closures from the same function.

    Returns:
        Lines of one table for each kind of wrench.
    """
    starts = {k: f["start_wrench"] for k, f in frames.items() if "start_wrench" in f}
    tables = {
        "wrenches through the bodies, at each frame's origin in its axes":
            ("frame", {name: frame["wrench"] for name, frame in frames.items()}),
        "wrenches at the start of links under their own weight": ("frame", starts),
        "wrenches of the closures, at the platform's origin, base axes":
            ("closure", {" - ".join(c["frames"]): c["wrench"] for c in closures}),
    }  # fmt: skip
    lines = []
    for title, (first, wrenches) in tables.items():
        if wrenches:
            shown = without_rounding(np.reshape(list(wrenches.values()), (-1, 6)))
            rows = dict(zip(wrenches, shown.tolist(), strict=True))
            lines += ["", title, *table_lines((first, *_HEAD), rows)]
    return lines
