"""Pictures of robots, of results at one point, and of data sets."""

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
        thing: object to draw. A robot is drawn in its home pose. A posture is drawn
            without errors. An assembly is drawn in its nominal and its forced state,
            with exaggerated displacements; with finite motions, large displacements are
            to scale. A platform stiffness is drawn as the compliance shares of its
            parts. A data set, which may also be given as the path of a NetCDF file, is
            drawn as maps over two axes or lines along one axis of a sweep, as
            histograms of draws, or as bars of tolerances.
        errors: for an assembly: ``"translation"`` or ``"rotation"`` to add the possible
            platform errors within the clearances.
        assumption: assumption of problem (27) for these errors: ``"frozen"``,
            ``"free"`` or ``"budget"``.
        interactive: True for an interactive scene, which a notebook displays and a
            browser opens (attribute ``html``); False for a matplotlib figure; None for
            a scene in a notebook and a figure elsewhere.  A data set has figures only.
        quantities: for a data set: variables to draw, or their components, such as
            ``["energy", "stiffness.FX"]``; by default those of figure 5 of the paper.
        at: for a sweep: values on the remaining axes by name; the nearest points are
            drawn. If no draw is selected, the median over all draws is drawn.
        kind: for draws or tolerances: ``"histogram"``, ``"tornado"`` or
            ``"allocation"``; None to choose the kind that suits the data set.

    Returns:
        The scene or the figure. A notebook displays it as the result of a cell.
        Otherwise a figure is not shown: use ``savefig`` to write it, or
        ``pyplot.show()`` to open a window.

    Raises:
        BadInput: the object has another type or many points; a file cannot be read; an
            axis or a quantity is unknown; more than two axes of a sweep remain; errors
            are requested for something else than an assembly, or for one with a free
            motion; or matplotlib is not installed.
        SolverFailed: the cone solver failed for the errors.
    """
    if isinstance(thing, Statistics):
        thing = thing.data
    whose = "show"
    if isinstance(thing, Path | str):
        whose, thing = str(thing), open_dataset(thing)
    if isinstance(thing, Shown):
        if quantities or at or kind:
            raise BadInput(
                f"show: found quantities, at or kind for a {type(thing).__name__}, "
                "expected them for a data set"
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
            "show: found errors or interactive=True for a data set, expected them for "
            "a result at one point"
        )
    try:
        drawn = figure_of_draws(thing, kind, quantities)
    except ValueError as error:
        raise BadInput(f"{whose}: {error}") from None
    if drawn is None:
        return figure_of(thing, at, quantities)
    show_figures_of_cells()
    return drawn
