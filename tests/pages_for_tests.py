"""Parse the tables, numbers, figures and results of an HTML report."""

import html
import json
import re
from dataclasses import dataclass, field
from html.parser import HTMLParser


@dataclass
class Cell:
    """Table cell or number, with its displayed text and its value in SI units."""

    text: str
    value: float | None
    si: str | None


@dataclass
class ParsedPage(HTMLParser):
    """Parsed content of a page, in order of appearance."""

    tables: list = field(default_factory=list)
    numbers: list = field(default_factory=list)
    figures: list = field(default_factory=list)
    results: dict = field(default_factory=dict)
    fetched: list = field(default_factory=list)
    tags: set = field(default_factory=set)

    def __post_init__(self):
        super().__init__()
        self._script = self._cell = self._number = None

    def handle_starttag(self, tag, attrs):
        given = dict(attrs)
        self.tags.add(tag)
        links = (given.get(k) for k in ("src", "href", "action", "data"))
        # links within the page begin with a hash
        own = ("data:", "#")
        self.fetched += [one for one in links if one and not one.startswith(own)]
        value = given.get("data-v")
        cell = Cell("", None if value is None else float(value), given.get("data-si"))
        if tag == "table":
            self.tables.append([])
        elif tag == "tr":
            self.tables[-1].append([])
        elif tag in {"td", "th"}:
            self._cell = cell
            self.tables[-1][-1].append(cell)
        elif tag == "span":
            self._number = cell
            self.numbers.append(cell)
        elif tag == "script":
            self._script = given.get("class") or given.get("type") or "code"

    def handle_endtag(self, tag):
        if tag in {"td", "th"}:
            self._cell = None
        elif tag == "span":
            self._number = None
        elif tag == "script":
            self._script = None

    def handle_data(self, data):
        if self._script == "results":
            self.results = json.loads(data)
        elif self._script == "spec":
            self.figures.append(json.loads(data))
        elif self._cell is not None:
            self._cell.text += data
        elif self._number is not None:
            self._number.text += data

    def table(self, *heads):
        """Return the only table whose first headings are ``heads``."""
        (one,) = (
            table
            for table in self.tables
            if [cell.text for cell in table[0][: len(heads)]] == list(heads)
        )
        return one


def parse(text):
    """Parse a page."""
    page = ParsedPage()
    page.feed(text)
    return page


def tiles(text):
    """Return the answer and the note of each tile at the top of a page, by title."""
    found = re.findall(
        r"<div class=tile><p class=title>(.*?)</p><p class=answer>(.*?)</p>"
        r"<p class=note>(.*?)</p></div>", text,
    )  # fmt: skip
    return {
        title: tuple(html.unescape(re.sub("<[^>]*>", "", one)) for one in rest)
        for title, *rest in found
    }
