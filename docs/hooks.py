"""What the site does to pages besides its theme."""

import re
from typing import Any

# a docstring's ":func:`name`", once its name is code
_ROLE = re.compile(r"(?<![\w:]):(?:func|mod|class|meth|data|attr|math):(?=<code>)")


def on_page_content(html: str, **_: Any) -> str:
    """Names in docstrings without the role that stands before them."""
    return _ROLE.sub("", html)
