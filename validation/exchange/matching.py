"""Which reading belongs to which target and which command."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from forcefit.inputs.errors import BadInput, describe, quoted
from validation.exchange.commands_table import Commands
from validation.exchange.device_table import Reading


@dataclass(frozen=True, eq=False)
class Match:
    """Readings in their places.

    Attributes:
        how: ``"name"``, ``"time"`` or ``"order"``: what joined them to commands.
        rows: for each row of the campaign its command and its readings by target;
            a target read again at a command makes a further row.
        unmatched: readings near no command.
    """

    how: str
    rows: list[tuple[int, dict[str, Reading]]]
    unmatched: list[Reading]


def match(
    readings: Sequence[Reading],
    commands: Commands,
    targets: Iterable[str],
    window: float,
) -> Match:
    """Join readings to commands: by name, else by time, else by order.

    Args:
        readings: in the order taken.
        commands: in the order given.
        targets: their names.
        window: [s] between a command and its readings.

    Returns:
        The rows.

    Raises:
        BadInput: a reading of no target, or no way to join them.
    """
    targets = list(targets)
    named = [_target(reading, targets) for reading in readings]
    ids = {label: i for i, label in enumerate(commands.ids)}
    asked = [
        [ids[part] for part in reading.names if part in ids and part != target]
        for reading, target in zip(readings, named, strict=True)
    ]
    if all(len(found) == 1 for found in asked):
        how, at = "name", [found[0] for found in asked]
    elif np.isfinite(commands.times).all() and all(
        np.isfinite(reading.time) for reading in readings
    ):
        how, at = "time", [_nearest(reading, commands, window) for reading in readings]
    else:
        how, at = "order", _in_order(readings, named, commands)
    table: dict[tuple[int, int], dict[str, Reading]] = {}
    again: Counter[tuple[int, str]] = Counter()
    for reading, target, command in zip(readings, named, at, strict=True):
        if command >= 0:
            table.setdefault((command, again[command, target]), {})[target] = reading
            again[command, target] += 1
    rows = [(command, cells) for (command, _), cells in sorted(
        table.items(), key=lambda item: item[0])]  # fmt: skip
    lost = [r for r, command in zip(readings, at, strict=True) if command < 0]
    if not rows:
        first = readings[0]
        raise BadInput(
            f"{first.place}: found no command within {window:g} s of any reading; "
            "expected clocks that agree, or a larger window in the targets file"
        )
    return Match(how, rows, lost)


def _target(reading: Reading, targets: list[str]) -> str:
    """The target that a reading's name names; the only one, if there is only one."""
    found = [part for part in reading.names if part in targets]
    if len(found) == 1:
        return found[0]
    if not found and len(targets) == 1:
        return targets[0]
    expected = ", ".join(map(quoted, targets[:6]))
    raise BadInput(
        f"{reading.place}: expected the name of one target in it: {expected}"
    )


def _nearest(reading: Reading, commands: Commands, window: float) -> int:
    """Row of the command nearest in time, -1 if none is within the window."""
    gaps = np.abs(commands.times - reading.time)
    return int(np.argmin(gaps)) if gaps.min() <= window else -1


def _in_order(
    readings: Sequence[Reading], named: list[str], commands: Commands
) -> list[int]:
    """The k-th reading of a target belongs to the k-th command."""
    counts: Mapping[str, int] = Counter(named)
    for target, count in counts.items():
        if count != len(commands.ids):
            raise BadInput(
                f"{readings[0].file}: found {count} readings of {quoted(target)} for "
                f"{len(commands.ids)} commands; expected the id of the command in "
                "their names, times in both tables, or as many readings as commands "
                f"(names such as {describe('::'.join(readings[0].names))})"
            )
    at, seen = [], Counter[str]()
    for target in named:
        at.append(seen[target])
        seen[target] += 1
    return at
