"""A whole page: what is concluded, what it rests on, and the pieces between.

======================  =============================================================
:func:`page`            the page around its pieces
:class:`Tile`           one conclusion at the top, for a reader in a hurry
:class:`Provenance`     command, versions and digests of the files that were read
======================  =============================================================

plotly.js draws; it is inside the page, compressed, and nothing is fetched.
"""

import base64
import hashlib
import html
import json
import platform
import re
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from importlib.resources import files
from pathlib import Path
from typing import Any

from forcefit.inputs.errors import BadInput
from forcefit.page.charts import embedded
from forcefit.page.tables import Value, inline, table

_PACKAGES = ("numpy", "scipy", "clarabel", "cvxpy", "exudyn")
_BEFORE_UNIT = re.compile(r"(?<=\d) (?=(?:%|[nµumkM]?(?:m|rad|N|J|Pa|Hz))(?![\w]))")
_DIGITS = 300  # of the longest integer that a float holds, nearly
_BUTTONS = (
    "<div class=bar><button type=button id=units>SI units</button>"
    "<button type=button id=print>Print</button></div>"
)
_NO_SCRIPT = (
    "<noscript><p class=note>Charts need JavaScript; the numbers do not.</p></noscript>"
)


@dataclass(frozen=True)
class Tile:
    """One conclusion at the top of a page.

    Attributes:
        title: what it answers.
        answer: a few words or numbers.
        note: a sentence, of texts and numbers.
    """

    title: str
    answer: Sequence[str | Value]
    note: Sequence[str | Value] = ()


@dataclass(frozen=True)
class Provenance:
    """Where the numbers of a page come from.

    Attributes:
        command: that computed them, empty if it was not a command.
        files: that it read.
        settings: in words, such as the seed.
    """

    command: str = ""
    files: Sequence[Path] = ()
    settings: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Page:
    """The content of a page.

    Attributes:
        title: of the page.
        verdict: the conclusion in a few sentences.
        good: whether it is what one hopes for; None for neither.
        tiles: the same for a reader in a hurry.
        about: what was computed, below the title.
        body: pieces of HTML in their order.
        assumed: what the numbers rest on, a sentence each.
        provenance: where they come from.
        results: plain values, kept inside the page for ``forcefit report compare``.
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


def command_line() -> str:
    """The command that runs, as it was typed; empty where it is not ours."""
    import shlex

    name = Path(sys.argv[0]).name
    ours = name == "forcefit" or "forcefit" in Path(sys.argv[0]).parts[-2:]
    return shlex.join(["forcefit", *sys.argv[1:]]) if ours else ""


def page(content: Page) -> str:
    """A page as one HTML text, which needs no other file.

    Args:
        content: of the page.

    Returns:
        HTML; the results are inside it as JSON, SI, in full.
    """
    style, script = (_part(name).decode() for name in ("page.css", "page.js"))
    title = html.escape(content.title)
    kind = {True: "good", None: "mixed", False: "bad"}[content.good]
    parts = [
        "<!doctype html><html lang=en><head><meta charset=utf-8>",
        "<meta name=viewport content='width=device-width, initial-scale=1'>",
        f"<title>{title}</title><style>{style}</style></head><body>{_BUTTONS}",
        f"<h1>{title}</h1><p class=note>{html.escape(content.about)}</p>{_NO_SCRIPT}",
        f"<p class='verdict {kind}'>{_unbroken(html.escape(content.verdict))}</p>",
        f"<div class=tiles>{''.join(map(_tile, content.tiles))}</div>",
        *content.body,
        _assumed(content.assumed),
        _provenance(content.provenance),
        embedded(content.results, "results"),
    ]
    if any("class=spec>" in piece for piece in content.body):
        parts.append(f"<script type='text/plain' id=plotly>{_plotly()}</script>")
    return "\n".join([*parts, f"<script>{script}</script></body></html>\n"])


def results_in(text: str, where: str) -> dict[str, Any]:
    """The results that a page holds, or those of a JSON file.

    Args:
        text: of a page or of a JSON file of a command.
        where: its name, for messages.

    Returns:
        Plain values.

    Raises:
        BadInput: it is neither.
    """
    mark = '<script type="application/json" class=results>'
    if text.lstrip()[:15].lower() == "<!doctype html>":
        _, own, rest = text.partition(mark)
        if not own:
            raise BadInput(f"{where}: found a page without results of forcefit")
        text = rest.partition("</script>")[0]
    try:
        results = json.loads(text, parse_int=_whole)
    except (ValueError, RecursionError):  # of brackets by the thousand
        expected = "a report of forcefit or the JSON file of a command"
        raise BadInput(f"{where}: found other text, expected {expected}") from None
    if not isinstance(results, dict):
        raise BadInput(f"{where}: found a JSON list or value, expected results")
    return results


def _whole(text: str) -> int | float:
    """An integer of JSON; one beyond all floats is infinite."""
    return int(text) if len(text) <= _DIGITS else float(text)


def section(title: str, *pieces: str) -> str:
    """A heading and what stands below it."""
    return f"<section><h2>{html.escape(title)}</h2>{''.join(pieces)}</section>"


def paragraph(*texts: str | Value) -> str:
    """A paragraph of texts and numbers."""
    return f"<p>{_sentence(texts)}</p>"


def _sentence(texts: Sequence[str | Value]) -> str:
    """Texts, escaped, and numbers, which styles keep whole."""
    return "".join(
        inline(one) if isinstance(one, Value) else _unbroken(html.escape(one))
        for one in texts
    )


def _tile(tile: Tile) -> str:
    """A conclusion, its answer large."""
    return (
        f"<div class=tile><h3>{html.escape(tile.title)}</h3>"
        f"<p class=answer>{_sentence(tile.answer)}</p>"
        f"<p class=note>{_sentence(tile.note)}</p></div>"
    )


def _unbroken(text: str) -> str:
    """A text whose lines do not end between a number and its unit."""
    return _BEFORE_UNIT.sub("&nbsp;", text)


def _assumed(sentences: Sequence[str]) -> str:
    """What the numbers rest on."""
    items = "".join(f"<li>{html.escape(one)}</li>" for one in sentences)
    return section("What was assumed", f"<ul>{items}</ul>")


def _provenance(provenance: Provenance) -> str:
    """Command, versions and digests."""
    rows = [["command", provenance.command]] if provenance.command else []
    rows += [[name, value] for name, value in provenance.settings.items()]
    rows += [["forcefit", _version("forcefit")], ["Python", platform.python_version()]]
    rows += [[n, known] for n in _PACKAGES if (known := _version(n)) != "absent"]
    rows += [[f"SHA-256 of {one.name}", _digest(one)] for one in provenance.files]
    return section("Where the numbers come from", table(["what", "value"], rows))


def _version(package: str) -> str:
    """Of a package, if it is installed."""
    try:
        return version(package)
    except PackageNotFoundError:
        return "absent"


def _digest(path: Path) -> str:
    """SHA-256 of a file as it is now."""
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError as error:
        return f"cannot be read any more: {error.strerror}"


@cache
def _plotly() -> str:
    """plotly.js with the traces that pages draw, compressed and as text.

    ``plotly/build.mjs`` makes it.  A browser unpacks it in 0.1 s.

    Returns:
        base64 of a gzip file.
    """
    return base64.b64encode(_part("plotly/plotly.min.js.gz")).decode()


def _part(name: str) -> bytes:
    """A file that comes with this chapter."""
    return files("forcefit.page").joinpath(*name.split("/")).read_bytes()
