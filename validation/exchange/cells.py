"""Read the cells of a device table in one of several text encodings."""

import codecs
import csv
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from forcefit.inputs.errors import BadInput
from forcefit.inputs.table import read_bytes

_MARKS = (";", "\t", ",")  # possible separators between cells
_BLANK = " "
# matches a number with a decimal comma
_QUOTED = re.compile(r"[-+]?\d*,\d+(?:[eE][-+]?\d+)?")
# Largest accepted number of characters in a cell. The time for the search for units is
# proportional to its square.
_LONGEST = 1000
_SAMPLE = 2000  # number of lines from which the separator is determined


@dataclass(frozen=True)
class Sheet:
    """Cells of a table.

    Attributes:
        file: path of the file, for messages.
        decimal: decimal mark of the table.
        rows: line number and cells of each line of the table.  Quotes and surrounding
            blanks are removed from cells.  Comments and blank lines are omitted.
    """

    file: str
    decimal: str
    rows: Sequence[tuple[int, list[str]]]


def read_sheet(path: Path | str, decimal: str = ".") -> Sheet:
    """Read the cells of a table.

    Args:
        path: a text file in UTF-8, UTF-16 or Latin-1.
        decimal: declared decimal mark.  If commas separate the cells, a decimal comma
            applies only if a quoted number contains one.

    Returns:
        The table.

    Raises:
        BadInput: the file cannot be read, is not text, or contains no rows.
    """
    lines = [
        (number, line.strip(" \r\n"))
        for number, line in enumerate(_text(path).split("\n"), 1)
        if line.strip() and not line.lstrip().startswith(("//", "#"))
    ]
    if not lines:
        raise BadInput(f"{path}: found an empty file, expected a table")
    mark = _mark([line for _, line in lines[:_SAMPLE]], decimal)
    rows = [(number, _cells(line, mark)) for number, line in lines]
    for number, cells in rows:
        if (longest := max(map(len, cells), default=0)) > _LONGEST:
            raise BadInput(
                f"{path}: line {number}: found a cell of {longest} characters, "
                f"expected at most {_LONGEST}"
            )
    if mark == _BLANK:
        rows = _with_names_of_words(lines, rows)
    quoted = any(_QUOTED.fullmatch(cell) for _, cells in rows for cell in cells)
    return Sheet(str(path), "." if mark == "," and not quoted else decimal, rows)


def _with_names_of_words(
    lines: Sequence[tuple[int, str]], rows: Sequence[tuple[int, list[str]]]
) -> list[tuple[int, list[str]]]:
    """Join the words of each heading if blanks separate the cells of a table."""
    usual = Counter(len(cells) for _, cells in rows).most_common(1)[0][0]
    return [
        (number, wide)
        if len(cells) != usual
        and len(wide := re.split(r"\s{2,}|\t", line.strip())) == usual
        else (number, cells)
        for (number, line), (_, cells) in zip(lines, rows, strict=True)
    ]


def _text(path: Path | str) -> str:
    """Return the text of a file in UTF-8, UTF-16 or Latin-1."""
    content = read_bytes(path)
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        encodings = ["utf-16"]
    # The encoding is UTF-16 without byte order mark.
    elif content[1:40:2].count(0) > 10:
        encodings = ["utf-16-le"]
    elif content[0:40:2].count(0) > 10:
        encodings = ["utf-16-be"]
    else:
        encodings = ["utf-8-sig", "cp1252", "latin-1"]
    for encoding in encodings:
        try:
            text = content.decode(encoding).replace("\r\n", "\n").replace("\r", "\n")
        except UnicodeDecodeError:
            continue
        if "\0" not in text:
            return text
        line = text.count("\n", 0, text.index("\0")) + 1
        raise BadInput(
            f"{path}: line {line}: found the character NUL; expected a text file"
        )
    raise BadInput(
        f"{path}: found a byte order mark of UTF-16 but no UTF-16 text; expected a "
        "text file"
    )


def _mark(lines: Sequence[str], decimal: str) -> str:
    """Return the separator that occurs in the largest number of lines."""
    for mark in _MARKS:
        if 2 * sum(mark in line for line in lines) < len(lines):
            continue
        blank = sum(len(line.split()) > 3 for line in lines)
        if mark == "," and decimal == "," and 2 * blank >= len(lines):
            return _BLANK  # blanks separate the cells, and commas are decimal marks
        return mark
    return _BLANK


def _cells(line: str, mark: str) -> list[str]:
    """Return the cells of a line."""
    if mark == _BLANK:
        line = re.sub(r"\s+(?=\[)", "", line.replace("\t", _BLANK).strip())  # X [mm]
    try:
        row = next(csv.reader([line], delimiter=mark, skipinitialspace=True))
    except csv.Error:  # a quote is not closed
        row = line.split(mark)
    return [cell.strip().strip('"').removeprefix("'").strip() for cell in row]
