"""Interactive figures for notebooks, each embedded in its own frame."""

import html
import sys
from dataclasses import dataclass
from io import BytesIO
from typing import TYPE_CHECKING, Any

from forcefit.page.markup import packaged, piece
from forcefit.page.page import packed_plotly

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_HEIGHT = 760  # [px] height of a scene with its controls and caption


@dataclass(frozen=True, eq=False)
class Picture:
    """Interactive figure for notebooks.

    The figure embeds plotly.js (0.8 MB), so that it works offline and without a running
    Python process.

    Attributes:
        title: title of the figure.
        html: complete HTML page, which can also be written to a file.
    """

    title: str
    html: str

    def __repr__(self) -> str:
        return f"Picture of {self.title}: its html is a page for a browser"

    def _repr_html_(self) -> str:
        """Return the page in a frame, which isolates its styles and identifiers."""
        title, inside = (html.escape(text) for text in (self.title, self.html))
        style = f"width:100%;height:{_HEIGHT}px;border:0;background:white"
        return f'<iframe title="{title}" style="{style}" srcdoc="{inside}"></iframe>'


def picture(title: str, figure: str) -> Picture:
    """Convert a figure of :mod:`forcefit.page.charts` to a picture for notebooks.

    Args:
        title: title of the figure.
        figure: HTML of the figure.

    Returns:
        Picture that a notebook displays.
    """
    style, script = (packaged(name).decode() for name in ("page.css", "page.js"))
    page = piece("alone", title, figure, style, script, packed_plotly())
    return Picture(title, page)


def in_notebook() -> bool:
    """Return whether the code runs in a notebook (IPython with a kernel)."""
    return getattr(_shell(), "kernel", None) is not None


def show_figures_of_cells() -> None:
    """Enable notebooks to display matplotlib figures that are returned by a cell.

    By default, IPython displays such figures only after pyplot has created a figure.  A
    display method chosen by the user, for example ``%matplotlib inline``, stays in
    effect.
    """
    if not in_notebook():
        return
    from matplotlib.figure import Figure

    formatters = _shell().display_formatter.formatters
    if not any(Figure in known for known in formatters.values()):
        formatters["image/png"].for_type(Figure, _png)


def _png(figure: "Figure") -> bytes:
    """Render a figure as PNG."""
    content = BytesIO()
    figure.savefig(content, format="png")
    return content.getvalue()


def _shell() -> Any:
    """Return the IPython shell, or None outside IPython."""
    return getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
