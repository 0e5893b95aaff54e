"""Interactive figures for notebooks: a figure of a page in a separate frame."""

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
    """A figure that the reader of a notebook can rotate, scale and switch.

    The figure contains plotly.js (0.8 MB).  It therefore needs neither the network nor
    a running Python process.

    Attributes:
        title: title of the figure.
        html: a complete HTML page, which may also be written to a file.
    """

    title: str
    html: str

    def __repr__(self) -> str:
        return f"Picture of {self.title}: its html is a page for a browser"

    def _repr_html_(self) -> str:
        """Return the page in a frame, which isolates its styles and its identifiers."""
        title, inside = (html.escape(text) for text in (self.title, self.html))
        style = f"width:100%;height:{_HEIGHT}px;border:0;background:white"
        return f'<iframe title="{title}" style="{style}" srcdoc="{inside}"></iframe>'


def picture(title: str, figure: str) -> Picture:
    """Return a figure of :mod:`forcefit.page.charts` as a picture.

    Args:
        title: title of the page that contains the figure.
        figure: HTML of the figure.

    Returns:
        The picture.
    """
    style, script = (packaged(name).decode() for name in ("page.css", "page.js"))
    page = piece("alone", title, figure, style, script, packed_plotly())
    return Picture(title, page)


def in_notebook() -> bool:
    """Return whether the code runs in a notebook, that is, in IPython with a kernel."""
    return getattr(_shell(), "kernel", None) is not None


def show_figures_of_cells() -> None:
    """Let a notebook display a matplotlib figure that is the result of a cell.

    IPython displays such figures only after pyplot has made a figure.  If the user
    chose a display method, such as ``%matplotlib inline``, it is not changed.
    """
    if not in_notebook():
        return
    from matplotlib.figure import Figure

    formatters = _shell().display_formatter.formatters
    if not any(Figure in known for known in formatters.values()):
        formatters["image/png"].for_type(Figure, _png)


def _png(figure: "Figure") -> bytes:
    """Return a figure as a PNG picture."""
    content = BytesIO()
    figure.savefig(content, format="png")
    return content.getvalue()


def _shell() -> Any:
    """Return the shell of IPython, or None outside IPython."""
    return getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
