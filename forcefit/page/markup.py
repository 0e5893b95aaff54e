"""HTML fragments rendered by the macros in ``page.jinja``, which escape all texts."""

import re
from functools import cache, partial
from importlib.resources import files
from typing import Any

_BEFORE_UNIT = re.compile(r"(?<=\d) (?=(?:%|[nµumkM]?(?:m|rad|N|J|Pa|Hz))(?![\w]))")


def piece(macro: str, *values: Any) -> str:
    """Render a macro of ``page.jinja`` as an HTML fragment."""
    return str(getattr(_template(), macro)(*values))


def packaged(name: str) -> bytes:
    """Return the content of a file installed with this package."""
    return files("forcefit.page").joinpath(*name.split("/")).read_bytes()


@cache
def _template() -> Any:
    """Return the macros of ``page.jinja``; jinja2 is imported on the first call."""
    from jinja2 import Environment, StrictUndefined

    pages = Environment(autoescape=True, trim_blocks=True, undefined=StrictUndefined)
    # prevents a line break between a number and its unit
    pages.filters["unbroken"] = partial(_BEFORE_UNIT.sub, "&nbsp;")
    compact = {"allow_nan": False, "separators": (",", ":")}
    pages.policies["json.dumps_kwargs"] = compact
    return pages.from_string(packaged("page.jinja").decode()).module
