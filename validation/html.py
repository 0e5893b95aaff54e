"""Pieces of a self-contained page: tables, and pictures inside it."""

import base64
import html
import io
from typing import Any

from numpy.typing import NDArray

_STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; max-width: 62rem; margin: 2rem auto;
       padding: 0 1rem; color: #222; }
h1 { font-size: 1.7rem; } h2 { font-size: 1.25rem; margin-top: 2.2rem;
     border-bottom: 1px solid #ddd; }
table { border-collapse: collapse; font-size: .85rem; margin: .8rem 0; }
td, th { border: 1px solid #ddd; padding: .2rem .55rem; text-align: right; }
th { background: #f5f5f5; } td:first-child, th:first-child { text-align: left; }
.verdict { font-size: 1.1rem; padding: .7rem 1rem; border-left: .4rem solid; }
.good { border-color: #2a7; background: #f0faf5; }
.bad { border-color: #c33; background: #fdf1f1; }
figure { margin: 1rem 0; } img { max-width: 100%; }
figcaption, .note { color: #555; font-size: .85rem; }
"""


def html_page(title: str, body: str) -> str:
    """A whole page around its body."""
    name = html.escape(title)
    return (
        "<!doctype html><html lang=en><head><meta charset=utf-8>"
        "<meta name=viewport content='width=device-width'>"
        f"<title>{name}</title><style>{_STYLE}</style></head>"
        f"<body>{body}</body></html>\n"
    )


def html_table(head: list[str], rows: list[list[str]]) -> str:
    """A table: its head and rows of texts."""
    top = "".join(f"<th>{html.escape(h)}</th>" for h in head)
    body = "".join(
        "<tr>" + "".join(f"<td>{html.escape(c)}</td>" for c in row) + "</tr>"
        for row in rows
    )
    return f"<table><tr>{top}</tr>{body}</table>"


def html_figure(figure: Any, caption: str) -> str:
    """A matplotlib figure as an image of the page."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=110)
    return html_image(buffer.getvalue(), caption)


def png_bytes(pixels: NDArray) -> bytes:
    """PNG of an RGB picture."""
    from matplotlib.image import imsave

    buffer = io.BytesIO()
    imsave(buffer, pixels, format="png")
    return buffer.getvalue()


def html_image(png: bytes, caption: str) -> str:
    """A picture inside the page."""
    data = base64.b64encode(png).decode()
    return (
        f"<figure><img alt='{html.escape(caption)}' src='data:image/png;base64,{data}'>"
        f"<figcaption>{html.escape(caption)}</figcaption></figure>"
    )
