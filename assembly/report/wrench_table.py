"""Text tables of wrenches."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from forcefit.assembly.linear.assembled import without_rounding
from forcefit.assembly.model.joint_names import closing_names, owner_of_contact
from forcefit.results.text import table_lines
from forcefit.stiffness.screws import WRENCH

_HEAD = tuple(f"{name} [{'N m' if name[0] == 'M' else 'N'}]" for name in WRENCH)


# last words in the frame names of joints that consist of several frames
_OF_JOINT = {
    "first", "second", "third", "turn", "slide", "slide_x", "slide_y"
}  # fmt: skip


def wrench_lines(
    frames: Mapping[str, Any], closures: Sequence[Any], joints: Mapping[str, str]
) -> list[str]:
    """Format the wrenches through all frames and closures as lines of text.

    A joint that consists of several frames has a single row, because the wrench through
    all these frames is the same. A joint that closes a loop is listed with the
    closures. The contacts of a joint have no rows.

    Args:
        frames: wrenches by frame, from
            :func:`forcefit.assembly.report.results.solution_of`.
        closures: wrenches of the closures from the same function.
        joints: main frame of each joint that consists of several frames.

    Returns:
        Lines of text with one table for each kind of wrench.
    """
    names = {*frames, *joints}
    closing = closing_names([c["frames"] for c in closures], names)
    starts = {k: f["start_wrench"] for k, f in frames.items() if "start_wrench" in f}
    tables = {
        "wrenches through the bodies, at each frame's origin in its axes":
            ("frame", {
                row: frame["wrench"] for name, frame in frames.items()
                if name not in closing and not owner_of_contact(name, names)
                and (row := _shown(name, joints))
            }),
        "wrenches at the start of links under their own weight": ("frame", starts),
        "wrenches of the closures, at the platform's origin, base axes":
            ("closure", {
                " - ".join(closing.get(name, name) for name in c["frames"]): c["wrench"]
                for c in closures
            }),
    }  # fmt: skip
    lines = []
    for title, (first, wrenches) in tables.items():
        if wrenches:
            shown = without_rounding(np.reshape(list(wrenches.values()), (-1, 6)))
            rows = dict(zip(wrenches, shown.tolist(), strict=True))
            lines += ["", title, *table_lines((first, *_HEAD), rows)]
    return lines


def _shown(name: str, joints: Mapping[str, str]) -> str:
    """Return the name of a frame in a table; empty if the frame has no row."""
    for joint, main in joints.items():
        if name == main:
            return joint
        if name.startswith(f"{joint}."):
            part = name[len(joint) + 1 :].partition(".")[0]
            if part in _OF_JOINT:
                return ""
    return name
