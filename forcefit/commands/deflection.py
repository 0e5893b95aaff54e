"""The command ``forcefit assembly deflection``."""

import math
from typing import Annotated

import typer

from forcefit.commands.options import (
    DriveForceOption,
    FigureOption,
    GravityOption,
    JointOption,
    JsonOption,
    LoadOption,
    MismatchOption,
    PoseOption,
    RestOption,
    RobotArgument,
    UnderOption,
    declared_under,
    parse_state,
)
from forcefit.commands.progress import one_thread, progress_lines
from forcefit.inputs.errors import BadInput, describe, nearest
from forcefit.inputs.writing import PICTURE, check_writable, save_figure, write_json

_MOST = 10_000  # largest number of load values on a curve


def deflection(
    robot: RobotArgument,
    along: Annotated[
        str,
        typer.Option(
            help="Component of the load that varies, as from:to:step [N or N m], "
            "such as fz=0:-500:10."
        ),
    ],
    pose: PoseOption = None,
    joint: JointOption = None,
    rest: RestOption = None,
    mismatch: MismatchOption = None,
    load: LoadOption = None,
    drive_force: DriveForceOption = None,
    gravity: GravityOption = None,
    under: UnderOption = None,
    state: Annotated[
        str,
        typer.Option(
            help="contact (errors, loads, clearances) | exact (finite motions: large "
            "deflections, buckling)."
        ),
    ] = "contact",
    back: Annotated[
        bool, typer.Option("--back", help="Return to the first load afterwards.")
    ] = False,
    follow: Annotated[
        bool,
        typer.Option(
            "--follow",
            help="Follow the equilibrium path by arc length past limit points, also "
            "where it is unstable (finite motions, clearances at zero).",
        ),
    ] = False,
    figure: FigureOption = None,
    json: JsonOption = None,
) -> None:
    """Compute load-deflection curves, up to critical loads.

    The curve includes free motion within clearances, contacts, elastic deformation and
    jumps to another equilibrium.
    """
    from forcefit.assembly.model.statuses import OK
    from forcefit.assembly.report.deflection import (
        deflection_of,
        deflection_text,
        plot_deflection,
    )

    if follow and back:
        raise BadInput(
            "--follow: found together with --back; remove --back, because a followed "
            "path turns at its limit points"
        )
    if figure is not None:
        check_writable(figure, PICTURE)
    exact = parse_state(state, ("contact", "exact")) == "exact"
    component, loads = parse_along(along)
    loads = [*loads, *reversed(loads[:-1])] if back else loads
    applied = declared_under(
        robot, pose, joint, load, gravity, under, finite=exact or follow,
        rest=rest, mismatch=mismatch, drive_force=drive_force,
    )  # fmt: skip
    with one_thread(), progress_lines() as update:
        results = deflection_of(
            applied.posture, component, loads, applied.load, applied.gravity,
            "exact" if exact else "contact", follow, update,
        )  # fmt: skip
    write_json(results, json)
    if json != "-":
        print(deflection_text(results))
    if figure is not None and "deflection" in results:
        save_figure(plot_deflection(results), figure)
    if results["status"] != OK:
        raise typer.Exit(1)


def parse_along(text: str) -> tuple[int, list[float]]:
    """Return the component and the values of ``--along``.

    Args:
        text: text such as ``"fz=0:-500:10"``; the sign of the step does not matter.

    Returns:
        Row of the component in the wrench ``[M F]``, and the values of the load [N
        m or N].  The last value is included if the distance is a multiple of the
        step.

    Raises:
        BadInput: the text has a different form, the load is constant, or the curve
            would have more than 10000 values.
    """
    from forcefit.assembly.model.largest import LARGEST
    from forcefit.stiffness.screws import WRENCH

    names = [name.lower() for name in WRENCH]
    name, _, values = (part.strip() for part in text.partition("="))
    expected = "expected COMPONENT=FROM:TO:STEP such as fz=0:-500:10"
    try:
        start, stop, step = (float(part) for part in values.split(":"))
    except ValueError:
        raise BadInput(f"--along: found {describe(text)}, {expected}") from None
    if name not in names:
        raise BadInput(
            f'--along: unknown component "{name[:60]}"{nearest(name, names)}'
        )
    if not all(abs(value) <= LARGEST for value in (start, stop, step)):
        raise BadInput(f"--along: found {describe(text)}, expected finite numbers")
    if step == 0.0 or start == stop:
        raise BadInput(
            f"--along: found {describe(text)}, expected two different loads and a step "
            "that is not 0"
        )
    count = math.floor(abs(stop - start) / abs(step) + 1e-9)
    if count >= _MOST:
        raise BadInput(f"--along: found {count + 1} loads, expected at most {_MOST}")
    step = math.copysign(step, stop - start)
    return names.index(name), [start + k * step for k in range(count + 1)]
