"""HTML of pages from the macros of ``page.jinja``, which escape all texts."""

import re
from functools import cache, partial
from importlib.resources import files
from typing import Any

_BEFORE_UNIT = re.compile(r"(?<=\d) (?=(?:%|[nµumkM]?(?:m|rad|N|J|Pa|Hz))(?![\w]))")


def piece(macro: str, *values: Any) -> str:
    """Return a piece of a page as HTML, rendered by a macro of ``page.jinja``."""
    return str(getattr(_template(), macro)(*values))


def packaged(name: str) -> bytes:
    """Return the content of a file that is installed with this package."""
    return files("forcefit.page").joinpath(*name.split("/")).read_bytes()


@cache
def _template() -> Any:
    """Return the macros of ``page.jinja``; import jinja2 only when this is called."""
    from jinja2 import Environment, StrictUndefined

    pages = Environment(autoescape=True, trim_blocks=True, undefined=StrictUndefined)
    # a line break between a number and its unit is not allowed
    pages.filters["unbroken"] = partial(_BEFORE_UNIT.sub, "&nbsp;")
    compact = {"allow_nan": False, "separators": (",", ":")}
    pages.policies["json.dumps_kwargs"] = compact
    return pages.from_string(packaged("page.jinja").decode()).module
