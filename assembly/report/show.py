"""Interactive scenes and figures of robots and results."""

from typing import TYPE_CHECKING, Any

from forcefit.assembly.exact.exact import ExactAssembly
from forcefit.assembly.kinematics.posture import Posture, home_posture
from forcefit.assembly.linear.energy import Assembly
from forcefit.assembly.model.robot import Robot
from forcefit.assembly.platform_stiffness.matrices import PlatformStiffness
from forcefit.assembly.report.error_body import possible_errors
from forcefit.assembly.report.platform_stiffness import stiffness_values
from forcefit.assembly.report.scene import exact_scene, forced_scene, nominal_scene
from forcefit.assembly.report.scene_figure import scene_figure
from forcefit.assembly.report.share_pictures import plot_shares, share_chart
from forcefit.inputs.errors import BadInput
from forcefit.inputs.packages import naming_packages
from forcefit.page.charts import scene
from forcefit.page.picture import Picture, in_notebook, picture

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Shown = Robot | Posture | Assembly | ExactAssembly | PlatformStiffness
_NOMINAL = "Red: elastic links; blue: rigid bodies; orange: driven joints."
_FORCED = f"Nominal (grey) and forced minimum-energy robot. {_NOMINAL}"
_EXACT = f"Nominal (grey) and forced robot with finite motions. {_NOMINAL}"
_SHARES = "Compliance shares of the parts along each axis of the platform."


def show(
    thing: Shown,
    *,
    errors: str | None = None,
    assumption: str = "frozen",
    interactive: bool | None = None,
) -> "Picture | Figure":
    """Draw a robot or a result at one point.

    Args:
        thing: object to draw. A robot is drawn in its home pose. A posture is drawn
            without errors. An assembly is drawn in its nominal and its forced state
            with magnified displacements. A platform stiffness is drawn as the
            compliance contribution of each body.
        errors: for an assembly: ``"translation"`` or ``"rotation"`` to add the set of
            platform errors due to clearances.
        assumption: assumption of problem (27) for this set: ``"frozen"``,
            ``"free"`` or ``"budget"``.
        interactive: True for an interactive 3D scene, whose attribute ``html`` is a
            page for the browser; False for a matplotlib figure; None for a scene in
            notebooks and a figure elsewhere.

    Returns:
        The scene or the figure. In a script, use ``savefig`` or ``pyplot.show()`` to
        see a figure.

    Raises:
        BadInput: the type of the object is not supported, or the object has many
            points; ``errors`` is given for an object that is not an assembly, or for an
            assembly with a free motion; or matplotlib is not installed.
        SolverFailed: the cone solver failed for ``errors``.
    """
    if interactive is None:
        interactive = in_notebook()
    if errors is not None and not isinstance(thing, Assembly):
        kind = type(thing).__name__
        raise BadInput(
            f"show: found errors for a {kind}, expected errors for an Assembly"
        )
    if isinstance(thing, PlatformStiffness):
        return _shares(thing, interactive)
    spec, name, caption = _scene(thing, errors, assumption)
    if interactive:
        return picture(name, scene(spec, caption))
    with naming_packages("show", "a browser: show(.., interactive=True)"):
        return scene_figure(spec, name)


def _scene(
    thing: object, errors: str | None, assumption: str
) -> tuple[dict[str, Any], str, str]:
    """Return the data of a scene, the name of the robot, and a caption."""
    if isinstance(thing, Robot):
        return nominal_scene(home_posture(thing)), thing.name, _NOMINAL
    if isinstance(thing, ExactAssembly):
        return exact_scene(thing), thing.posture.robot.name, _EXACT
    if not isinstance(thing, Posture | Assembly):
        expected = "expected a Robot, Posture, assembly or PlatformStiffness"
        raise BadInput(f"show: found {type(thing).__name__}, {expected}")
    posture = thing if isinstance(thing, Posture) else thing.posture
    many = isinstance(thing, Assembly) and thing.of_many
    if many or posture.transforms.ndim > 3:
        kind = type(thing).__name__
        raise BadInput(f"show: found {kind} of many points, expected a single point")
    if isinstance(thing, Posture):
        return nominal_scene(thing), thing.robot.name, _NOMINAL
    body, caption = None, _FORCED
    if errors is not None:
        body = possible_errors(thing, errors, assumption)
        caption += f" Yellow: possible {errors} errors (assumption {assumption})."
    return forced_scene(thing, body=body), posture.robot.name, caption


def _shares(stiffness: PlatformStiffness, interactive: bool) -> "Picture | Figure":
    """Draw the contributions to the platform compliance."""
    shares = stiffness_values(stiffness, stiffness.point)["shares"]
    name = stiffness.posture.robot.name
    if interactive:
        return picture(name, share_chart(shares, _SHARES))
    with naming_packages("show", "a browser: show(.., interactive=True)"):
        from matplotlib import pyplot

        figure = pyplot.figure(figsize=(8.0, 4.5), layout="constrained")
        return plot_shares({"shares": shares, "robot": name}, figure)
