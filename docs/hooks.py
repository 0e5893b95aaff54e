"""What the site does to pages besides its theme."""

import re
from pathlib import Path
from typing import Any

# a docstring's ":func:`name`", once its name is code
_ROLE = re.compile(r"(?<![\w:]):(?:func|mod|class|meth|data|attr|math):(?=<code>)")

# a number of a module, and its reason behind it
_NUMBER = re.compile(
    r"^_?([A-Z][A-Z_]*)(?:: .+)? = ([^\"'#\n]*\d[^\"'#\n]*)  # (.+)$", re.M
)
_NUMBERS = "<!-- numbers of the code -->"


def on_page_markdown(markdown: str, **_: Any) -> str:
    """The table of a diagnosis's numbers, taken from the modules that hold them."""
    return markdown.replace(_NUMBERS, _numbers()) if _NUMBERS in markdown else markdown


def _numbers() -> str:
    """A table of all numbers of ``validation/diagnosis``."""
    rows = ["| module | number | value | what it is |", "|---|---|---|---|"]
    root = Path(__file__).parents[1] / "validation" / "diagnosis"
    for path in sorted(root.glob("*.py")):
        for name, value, reason in _NUMBER.findall(path.read_text(encoding="utf-8")):
            words = name.lower().replace("_", " "), reason.replace("|", "or")
            rows.append(f"| {path.stem} | {words[0]} | {value} | {words[1]} |")
    return "\n".join(rows)


def on_page_content(html: str, **_: Any) -> str:
    """Names in docstrings without the role that stands before them."""
    return _ROLE.sub("", html)
