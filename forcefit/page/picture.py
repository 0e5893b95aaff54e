"""Interactive figures for notebooks: one figure of a page, in a frame of its own."""

import html
import sys
from dataclasses import dataclass
from io import BytesIO
from typing import TYPE_CHECKING, Any

from forcefit.page.markup import packaged, piece
from forcefit.page.page import packed_plotly

if TYPE_CHECKING:
    from matplotlib.figure import Figure

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
    return getattr(_shell(), "kernel", None) is not None


def show_figures_of_cells() -> None:
    """Let a notebook show a figure of matplotlib that is the result of a cell.

    IPython does so itself only after the first figure of pyplot.  A way that the user
    chose, such as ``%matplotlib inline``, is left as it is.
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
    """Return IPython's shell, None outside IPython."""
    return getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
