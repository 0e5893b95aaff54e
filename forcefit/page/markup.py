"""The markup of pages: the macros of ``page.jinja``, which escape all texts."""

import re
from functools import cache, partial
from importlib.resources import files
from typing import Any

_BEFORE_UNIT = re.compile(r"(?<=\d) (?=(?:%|[nµumkM]?(?:m|rad|N|J|Pa|Hz))(?![\w]))")


def piece(macro: str, *values: Any) -> str:
    """Return a piece of a page as HTML: the result of a macro of ``page.jinja``."""
    return str(getattr(_template(), macro)(*values))


def packaged(name: str) -> bytes:
    """Return the content of a file of this package."""
    return files("forcefit.page").joinpath(*name.split("/")).read_bytes()


@cache
def _template() -> Any:
    """Return macros of ``page.jinja``; jinja2 is imported for the first page only."""
    from jinja2 import Environment, StrictUndefined

    pages = Environment(autoescape=True, trim_blocks=True, undefined=StrictUndefined)
    # a line must not be broken between a number and its unit
    pages.filters["unbroken"] = partial(_BEFORE_UNIT.sub, "&nbsp;")
    compact = {"allow_nan": False, "separators": (",", ":")}
    pages.policies["json.dumps_kwargs"] = compact
    return pages.from_string(packaged("page.jinja").decode()).module
