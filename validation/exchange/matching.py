"""Assign readings to targets and to commands."""

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from forcefit.inputs.errors import BadInput, describe, quoted
from forcefit.validation.exchange.commands_table import Commands
from forcefit.validation.exchange.reading import Reading


@dataclass(frozen=True, eq=False)
class Match:
    """Readings assigned to targets and commands.

    Attributes:
        how: method of the assignment: ``"name"``, ``"time"`` or ``"order"``.
        rows: rows of the campaign, each with the index of its command and a mapping
            from target to reading.  A second reading of a target at the same command
            starts a new row.
        strangers: readings of points that are not targets, for example ground points.
        unmatched: readings of targets to which no command was assigned.
        missing: readings without a position.
        duplicates: readings with the same digits as an earlier reading in the same
            file. They are omitted.
        copies: readings with the same digits as a reading in a different file. They are
            used, because rounded readings may be equal by chance.
    """

    how: str
    rows: list[tuple[int, dict[str, Reading]]]
    strangers: list[Reading]
    unmatched: list[Reading]
    missing: list[Reading]
    duplicates: list[Reading]
    copies: list[Reading]


def match(
    readings: Sequence[Reading],
    commands: Commands,
    targets: Iterable[str],
    window: float,
) -> Match:
    """Assign readings to commands by name, by time or by order.

    Args:
        readings: readings in the order of measurement.
        commands: commands in the order of their table.
        targets: names of the targets.
        window: [s] largest time between a command and its readings.

    Returns:
        The assigned rows and the unassigned readings.

    Raises:
        BadInput: no reading belongs to a target, a reading contains the names of two
            targets, or the readings cannot be assigned to commands.
    """
    ours = _of_targets(readings, list(targets))
    lost = {id(reading) for reading, _ in ours}
    strangers = [reading for reading in readings if id(reading) not in lost]
    clocks = [*commands.times, *(reading.time for reading, _ in ours)]
    ids = set(commands.ids)
    parts = [[part for part in r.names if part in ids] for r, _ in ours]
    if named := _of_commands(ours, parts, commands.ids):
        how, at = "name", named
    elif np.isfinite(clocks).all():
        how, at = "time", [_nearest(reading, commands, window) for reading, _ in ours]
    elif named := _of_commands(
        ours, _within([reading for reading, _ in ours], commands.ids), commands.ids
    ):
        how, at = "name", named
    else:
        how, at = "order", _in_order(ours, commands)
    table: dict[tuple[int, int], dict[str, Reading]] = {}
    seen: dict[tuple[int, str], list[Reading]] = {}
    missing, duplicates, copies = [], [], []
    for (reading, target), command in zip(ours, at, strict=True):
        if command < 0:
            continue
        before = seen.setdefault((command, target), [])
        if np.isnan(reading.position).any():
            missing.append(reading)
        elif any(_same(reading, o) and reading.file == o.file for o in before):
            duplicates.append(reading)
        else:
            copies += [reading] if any(_same(reading, o) for o in before) else []
            table.setdefault((command, len(before)), {})[target] = reading
            before.append(reading)
    if not table and missing:
        raise BadInput(
            f"{missing[0].place}: found no coordinates; all other readings of the "
            "file have none either; expected numbers"
        )
    if not table:
        raise BadInput(
            f"{ours[0][0].place}: found no command within {window:g} s of any reading; "
            "expected clocks that agree, or a larger window in the targets file"
        )
    rows = [(command, table[command, k]) for command, k in sorted(table)]
    unmatched = [r for (r, _), command in zip(ours, at, strict=True) if command < 0]
    return Match(how, rows, strangers, unmatched, missing, duplicates, copies)


def _repeated(readings: Sequence[Reading]) -> str:
    """Return a hint for the message about the first duplicate reading."""
    seen: dict[object, Reading] = {}
    for reading in readings:
        digits = (reading.names, reading.position.tobytes(), str(reading.time))
        other = seen.setdefault(digits, reading)
        if other is not reading:
            return f"; line {reading.line} repeats line {other.line}"
    return ""


def _same(a: Reading, b: Reading) -> bool:
    """Return whether two readings have the same digits, name and time."""
    timed = a.time == b.time or bool(np.isnan(a.time) and np.isnan(b.time))
    return timed and a.names == b.names and np.array_equal(a.position, b.position)


def _of_targets(
    readings: Sequence[Reading], targets: list[str]
) -> list[tuple[Reading, str]]:
    """Return the readings of targets, each with the name of its target."""
    ours = []
    found = [
        [part for part in reading.names if part in targets] for reading in readings
    ]
    for reading, named in zip(
        readings, found if any(found) else _within(readings, targets), strict=True
    ):
        if len(named) > 1:
            expected = ", ".join(map(quoted, targets[:6]))
            raise BadInput(
                f"{reading.place}: found the names of several targets, expected one: "
                f"{expected}"
            )
        if named:
            ours.append((reading, named[0]))
    if not ours and len(targets) == 1:
        return [(reading, targets[0]) for reading in readings]
    if not ours:
        expected = ", ".join(map(quoted, targets[:6]))
        raise BadInput(
            f"{readings[0].place}: found no name of a target, expected one of: "
            f"{expected}"
        )
    return ours


def _of_commands(
    ours: list[tuple[Reading, str]], found: list[list[str]], ids: Sequence[str]
) -> list[int]:
    """Return the command index of each reading from its name; -1 if it has none.

    The list is empty unless most names contain the id of exactly one command.
    """
    index = {label: i for i, label in enumerate(ids)}
    asked = [
        [index[label] for label in labels if label != target]
        for labels, (_, target) in zip(found, ours, strict=True)
    ]
    if sum(len(indices) == 1 for indices in asked) <= len(asked) / 2:
        return []
    return [indices[0] if len(indices) == 1 else -1 for indices in asked]


def _within(readings: Sequence[Reading], labels: Sequence[str]) -> list[list[str]]:
    """Return the label that each reading's name contains: SMR1 in ``p04_SMR1``.

    A label must not be adjacent to a letter or digit.  If labels overlap, the longest
    label is returned.
    """
    longest = sorted(labels, key=len, reverse=True)
    words = "|".join(map(re.escape, longest))
    pattern = re.compile(rf"(?<![^\W_])(?:{words})(?![^\W_])")
    return [pattern.findall(" ".join(reading.names)) for reading in readings]


def _nearest(reading: Reading, commands: Commands, window: float) -> int:
    """Return the index of the command nearest in time; -1 if none is in the window."""
    gaps = np.abs(commands.times - reading.time)
    return int(np.argmin(gaps)) if gaps.min() <= window else -1


def _in_order(ours: list[tuple[Reading, str]], commands: Commands) -> list[int]:
    """Assign the k-th reading of a target to the k-th command."""
    named = [target for _, target in ours]
    first = ours[0][0]
    counts: Mapping[str, int] = Counter(named)
    for target, count in counts.items():
        if count != len(commands.ids):
            raise BadInput(
                f"{first.file}: found {count} readings of {quoted(target)} for "
                f"{len(commands.ids)} commands; expected the id of the command "
                "in the readings' names, times in both tables, or as many "
                "readings as commands (found names such as "
                f"{describe('::'.join(first.names))})"
                f"{_repeated([r for r, t in ours if t == target])}"
            )
    at, seen = [], Counter[str]()
    for target in named:
        at.append(seen[target])
        seen[target] += 1
    return at
