"""User-defined names are shown unchanged in all figures."""

import numpy as np
import pytest
import xarray

from forcefit.assembly.statistics.plot import (
    allocation_figure,
    histogram_figure,
    tornado_figure,
)
from forcefit.assembly.sweeps.maps import map_figure
from forcefit.inputs.errors import plot_label

ODD = ["$x^{<b>&_\\$", "a$b", "$\\frac{1}{$", "_$_$", "\\$", "\\\\$a$", "^_\\&<>"]


def drawn(figure):
    """Draw the figure; text that is wrongly parsed as a formula raises an error."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    FigureCanvasAgg(figure).draw()
    return figure


def drawn_texts(figure):
    """Return all texts in a figure after drawing."""
    from matplotlib.text import Text

    return [text.get_text() for text in drawn(figure).findobj(Text)]


@pytest.mark.parametrize("name", ODD)
def test_matplotlib_shows_a_name_unchanged(name):
    """The text is as wide as the same text drawn without formula parsing."""
    from matplotlib.figure import Figure

    figure = Figure()
    shown = figure.text(0, 0, plot_label(name))
    plain = figure.text(0, 0.5, name, parse_math=False)
    drawn(figure)
    wide, expected = (t.get_window_extent().width for t in (shown, plain))
    assert wide == pytest.approx(expected, abs=0.5)


def grid(count, axes):
    """Return a sweep data set in which all user-defined names are unusual."""
    shape = tuple(count[: len(axes)])
    values = np.ones(shape)
    status = np.full(shape, "ok", dtype=object)
    near = np.full(shape, f"parallel: {ODD[2]}, {ODD[4]}", dtype=object)
    names = ("margin", "margin_free", "energy", "condition")
    data = {name: (axes, values) for name in names}
    data |= {"status": (axes, status), "near_singularity": (axes, near)}
    data["platform_screw"] = ((*axes, "screw"), np.ones((*shape, 6)))
    coords = {a: np.arange(n, dtype=float) for a, n in zip(axes, shape, strict=True)}
    return xarray.Dataset(data, coords, {"robot": ODD[0]})


def test_constant_map_has_no_colour_scale():
    data = grid((2, 3), ("tx", "ty"))
    data["energy"] = (("tx", "ty"), np.arange(6.0).reshape(2, 3))
    figure = map_figure(data)
    shown = drawn_texts(figure)
    assert sum(text.endswith(" everywhere") for text in shown) == 4
    assert len(figure.axes) == 6 + 1  # six panels, and the colour scale of the energy


def test_statistics_figures_show_names_unchanged():
    attrs = {"robot": ODD[0], "seed": 1, "clearance": "worst"}
    draws = {"energy": ("draw", np.arange(5.0)), "status": ("draw", np.zeros(5))}
    shown = drawn_texts(histogram_figure(xarray.Dataset(draws, attrs=attrs)))
    assert any(text.startswith(plot_label(ODD[0])) for text in shown)
    shares = np.full((1, len(ODD), 3), 0.5)
    axes = ("quantity", "group", "estimate")
    coords = {"quantity": ["energy"], "group": ODD}
    coords["estimate"] = ["value", "lower", "upper"]
    indices = {key: (axes, shares) for key in ("first_index", "total_index")}
    labels = {plot_label(name) for name in ODD}
    assert labels <= {*drawn_texts(tornado_figure(xarray.Dataset(indices, coords)))}
    sizes = {
        key: ("class", np.full(len(ODD), 1e-4))
        for key in ("tolerance", "loosest_allowed", "scaled_alike")
    }
    sizes["unit"] = ("class", np.full(len(ODD), "m"))
    plan = xarray.Dataset(sizes, {"class": ODD}, {"said": f"{ODD[0]}; {ODD[2]}"})
    shown = drawn_texts(allocation_figure(plan))
    assert labels <= {*shown}
    assert any(plot_label(f"{ODD[0]}\n{ODD[2]}") in text for text in shown)
