"""Report page with conclusions, sections, assumptions and provenance.

======================  =============================================================
:func:`page`            composes the page
:class:`Tile`           one conclusion at the top
:class:`Provenance`     command, versions, and hashes of the input files
======================  =============================================================

The charts are drawn by plotly.js, which is embedded in compressed form, so that the
page works offline.
"""

import base64
import hashlib
import json
import platform
import re
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from forcefit.inputs.errors import BadInput
from forcefit.inputs.writing import plain
from forcefit.page.markup import packaged, piece
from forcefit.page.tables import Value, table

_PACKAGES = ("numpy", "scipy", "clarabel", "cvxpy", "exudyn")
_DIGITS = 300  # integers with at most this many decimal digits fit into a float
# CSS class and label of the verdict: favourable, with reservations, unfavourable
_STATES = {True: ("good", "OK"), None: ("mixed", "Caution"), False: ("bad", "Not OK")}
_HEADING = re.compile(r'<section id="([^"]+)"><h2>(.*?) <a class=anchor')


@dataclass(frozen=True)
class Tile:
    """Conclusion at the top of a page.

    Attributes:
        title: subject of the conclusion.
        answer: conclusion, in a few words or numbers.
        note: explanatory sentence, composed of texts and numbers.
    """

    title: str
    answer: Sequence[str | Value]
    note: Sequence[str | Value] = ()


@dataclass(frozen=True)
class Provenance:
    """Origin of the numbers on a page.

    Attributes:
        command: command that computed the numbers; empty outside the command line.
        files: input files.
        settings: additional settings as text, for example the seed.
    """

    command: str = ""
    files: Sequence[Path] = ()
    settings: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Page:
    """Content of a page.

    Attributes:
        title: title of the page.
        verdict: conclusion in one sentence.
        good: whether the result is favourable (green); None if it is favourable with
            reservations (amber).  ``docs/reports.md`` states the criteria of each
            report.
        tiles: main conclusions, shown at the top.
        about: text below the title that states what was computed.
        body: HTML fragments in order of appearance.
        assumed: assumptions, one sentence each.
        provenance: origin of the numbers.
        results: plain values, embedded in the page for ``forcefit report compare``.
        details: additional sentences, shown below the verdict.
    """

    title: str
    verdict: str
    good: bool | None
    tiles: Sequence[Tile]
    about: str
    body: Sequence[str]
    assumed: Sequence[str]
    provenance: Provenance
    results: Mapping[str, Any]
    details: str = ""


def command_line() -> str:
    """Return the forcefit command as typed, or an empty string in other programs."""
    import shlex

    name = Path(sys.argv[0]).name
    ours = name == "forcefit" or "forcefit" in Path(sys.argv[0]).parts[-2:]
    return shlex.join(["forcefit", *sys.argv[1:]]) if ours else ""


def page(content: Page) -> str:
    """Render a page as self-contained HTML.

    Args:
        content: content of the page.

    Returns:
        HTML in which the results are embedded as JSON, in SI units at full precision.
    """
    sections = [
        *filter(None, content.body),
        section("Assumptions", listed(content.assumed)),
        section("Provenance", _provenance(content.provenance)),
    ]
    titles = [found for one in sections for found in _HEADING.findall(one)]
    drawn = any("class=spec>" in one for one in sections)
    style, script = (packaged(name).decode() for name in ("page.css", "page.js"))
    return piece(
        "page", content, *_STATES[content.good], sections, titles,
        plain(content.results), style, script, packed_plotly() if drawn else "",
    )  # fmt: skip


def results_in(text: str, where: str) -> dict[str, Any]:
    """Extract the results from a page or a JSON file.

    Args:
        text: text of a page, or of a JSON file written by a command.
        where: name of the file, for messages.

    Returns:
        Plain values.

    Raises:
        BadInput: the text is neither a page nor such a JSON file.
    """
    mark = '<script type="application/json" class=results>'
    if text.lstrip()[:15].lower() == "<!doctype html>":
        _, own, rest = text.partition(mark)
        if not own:
            raise BadInput(f"{where}: found an HTML page without forcefit results")
        text = rest.partition("</script>")[0]
    try:
        results = json.loads(text, parse_int=_whole)
    except (ValueError, RecursionError):  # brackets may be nested too deeply
        expected = "a forcefit report or JSON results of a command"
        found = "text that is neither HTML nor JSON"
        raise BadInput(f"{where}: found {found}, expected {expected}") from None
    if not isinstance(results, dict):
        raise BadInput(f"{where}: found a JSON list or value, expected a JSON object")
    return results


def _whole(text: str) -> int | float:
    """Parse a JSON integer; return infinity if it is too large for a float."""
    return int(text) if len(text) <= _DIGITS else float(text)


def section(title: str, *pieces: str) -> str:
    """Return a section whose heading links to itself."""
    name = re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-")
    return piece("section", title, f"section-{name}", pieces)


def paragraph(*texts: str | Value) -> str:
    """Return a paragraph composed of texts and numbers."""
    return piece("paragraph", texts)


def listed(texts: Sequence[str]) -> str:
    """Return texts as an HTML list."""
    return piece("list", texts)


def _provenance(provenance: Provenance) -> str:
    """Return a table with the command, package versions and file hashes."""
    rows = [["command", provenance.command]] if provenance.command else []
    rows += [[name, value] for name, value in provenance.settings.items()]
    rows += [["forcefit", _version("forcefit")], ["Python", platform.python_version()]]
    rows += [[n, known] for n in _PACKAGES if (known := _version(n)) != "absent"]
    rows += [[f"SHA-256 of {one.name}", _digest(one)] for one in provenance.files]
    return table(["item", "value"], rows)


def _version(package: str) -> str:
    """Return the version of a package, or ``absent`` if it is not installed."""
    try:
        return version(package)
    except PackageNotFoundError:
        return "absent"


def _digest(path: Path) -> str:
    """Return the SHA-256 hash of the current content of a file."""
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError as error:
        return f"can no longer be read: {error.strerror}"


@cache
def packed_plotly() -> str:
    """Return compressed plotly.js, reduced to the trace types that pages use.

    The reduced file is created by ``plotly/build.mjs``.  A browser decompresses it in
    0.1 s.

    Returns:
        Gzip file, encoded in base64.
    """
    return base64.b64encode(packaged("plotly/plotly.min.js.gz")).decode()
