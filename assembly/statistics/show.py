"""Figures of robots, of results at one posture, and of data sets."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from forcefit.assembly.report.show import Shown
from forcefit.assembly.report.show import show as show_point
from forcefit.assembly.statistics.plot import figure_of_draws
from forcefit.assembly.statistics.statistics import Statistics
from forcefit.assembly.sweeps.dataset import open_dataset
from forcefit.assembly.sweeps.maps import figure_of
from forcefit.inputs.errors import BadInput
from forcefit.page.picture import Picture, show_figures_of_cells

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure


def show(
    thing: "Shown | Statistics | xarray.Dataset | Path | str",
    *,
    errors: str | None = None,
    assumption: str = "frozen",
    interactive: bool | None = None,
    quantities: Sequence[str] = (),
    at: Mapping[str, float | str] | None = None,
    kind: str | None = None,
) -> "Picture | Figure":
    """Draw a robot, a result at one point, or a data set.

    Args:
        thing: object to draw, or the path of a NetCDF file. A robot is drawn in its
            home pose. A posture is drawn without errors. An assembly is drawn in its
            nominal and its forced state with magnified displacements. A platform
            stiffness is drawn as the compliance contribution of each body. Sweeps are
            drawn as maps or lines, random draws as histograms, and tolerances as bars.
        errors: for an assembly: ``"translation"`` or ``"rotation"`` to add the set of
            platform errors due to clearances.
        assumption: assumption of problem (27) for this set: ``"frozen"``, ``"free"`` or
            ``"budget"``.
        interactive: True for an interactive 3D scene, whose attribute ``html`` is a
            page for the browser; False for a matplotlib figure; None for a scene in
            notebooks and a figure elsewhere. Data sets are always drawn as figures.
        quantities: for a data set: variables or components to draw, such as
            ``["energy", "stiffness.FX"]``; by default those of figure 5 of the paper.
        at: for a sweep: values of the axes that are not drawn, by name. The nearest
            points are used. Without a value for ``draw``, medians over all draws are
            drawn.
        kind: for draws or tolerances: ``"histogram"``, ``"tornado"`` or
            ``"allocation"``; None to select the kind by the data set.

    Returns:
        The scene or the figure, which a notebook displays as the result of a cell. In a
        script, use ``savefig`` or ``pyplot.show()`` to see a figure.

    Raises:
        BadInput: the object has another type or many points; a file cannot be read; an
            axis or a quantity is unknown; a sweep has more than two axes without a
            value in ``at``; ``errors`` is given for another object than an assembly or
            for an assembly with a free motion; or matplotlib is not installed.
        SolverFailed: the cone solver failed for ``errors``.
    """
    if isinstance(thing, Statistics):
        thing = thing.data
    whose = "show"
    if isinstance(thing, Path | str):
        whose, thing = str(thing), open_dataset(thing)
    if isinstance(thing, Shown):
        if quantities or at or kind:
            raise BadInput(
                f"show: found quantities, at or kind for a {type(thing).__name__}; "
                "they are valid only for a data set"
            )
        return show_point(
            thing, errors=errors, assumption=assumption, interactive=interactive
        )
    if not hasattr(thing, "data_vars"):
        raise BadInput(
            f"show: found {type(thing).__name__}, expected a Robot, Posture, assembly, "
            "PlatformStiffness or data set"
        )
    if errors is not None or interactive:
        raise BadInput(
            "show: found errors or interactive=True for a data set; they are valid "
            "only for a result at one point"
        )
    try:
        drawn = figure_of_draws(thing, kind, quantities)
    except ValueError as error:
        raise BadInput(f"{whose}: {error}") from None
    if drawn is None:
        return figure_of(thing, at, quantities)
    show_figures_of_cells()
    return drawn
