"""Interactive figures for notebooks: one figure of a page, in a frame of its own."""

import html
import sys
from dataclasses import dataclass

from forcefit.page.markup import packaged, piece
from forcefit.page.page import packed_plotly

_HEIGHT = 760  # [px] of a scene with its controls and its caption


@dataclass(frozen=True, eq=False)
class Picture:
    """A figure that the reader of a notebook can turn, exaggerate and switch.

    Nothing is fetched and no program must run: plotly.js is inside, 0.8 MB.

    Attributes:
        title: of the figure.
        html: a complete HTML page, which may be written to a file.
    """

    title: str
    html: str

    def __repr__(self) -> str:
        return f"Picture of {self.title}: its html is a page for a browser"

    def _repr_html_(self) -> str:
        """Return the page in a frame, in which its styles and names are its own."""
        title, inside = (html.escape(text) for text in (self.title, self.html))
        style = f"width:100%;height:{_HEIGHT}px;border:0;background:white"
        return f'<iframe title="{title}" style="{style}" srcdoc="{inside}"></iframe>'


def picture(title: str, figure: str) -> Picture:
    """Return a figure of :mod:`forcefit.page.charts` as a picture.

    Args:
        title: of the page around it.
        figure: HTML.

    Returns:
        The picture.
    """
    style, script = (packaged(name).decode() for name in ("page.css", "page.js"))
    page = piece("alone", title, figure, style, script, packed_plotly())
    return Picture(title, page)


def in_notebook() -> bool:
    """Return whether a notebook shows what its cells return: IPython with a kernel."""
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return getattr(shell, "kernel", None) is not None
