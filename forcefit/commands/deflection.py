"""Command ``forcefit assembly deflection``."""

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
            help="Load component to vary, as from:to:step [N or N m], for example "
            "fz=0:-500:10."
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
        bool, typer.Option("--back", help="Then unload back to the first value.")
    ] = False,
    follow: Annotated[
        bool,
        typer.Option(
            "--follow",
            help="Follow the equilibrium path by arc length beyond limit points, "
            "including unstable branches (finite motions, clearances at zero).",
        ),
    ] = False,
    figure: FigureOption = None,
    json: JsonOption = None,
) -> None:
    """Compute load-deflection curves up to critical loads.

    The curve includes free motion within clearances, contact, elastic deformation and
    jumps to a different equilibrium.
    """
    from forcefit.assembly.model.statuses import OK
    from forcefit.assembly.report.deflection import (
        deflection_of,
        deflection_text,
        plot_deflection,
    )

    if follow and back:
        raise BadInput(
            "--follow: found together with --back; remove --back, because the load "
            "already reverses at the limit points of a followed path"
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
    """Parse the load component and its values from ``--along``.

    Args:
        text: for example ``"fz=0:-500:10"``; the sign of the step is ignored.

    Returns:
        Index of the component in the wrench ``[M F]``, and the load values [N m or N].
        The end value is included if the range is a multiple of the step.

    Raises:
        BadInput: the text has an invalid form, the load is constant, or the curve would
            have more than 10000 values.
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
            f"--along: found {describe(text)}, expected two different loads and a "
            "nonzero step"
        )
    count = math.floor(abs(stop - start) / abs(step) + 1e-9)
    if count >= _MOST:
        raise BadInput(f"--along: found {count + 1} loads, expected at most {_MOST}")
    step = math.copysign(step, stop - start)
    return names.index(name), [start + k * step for k in range(count + 1)]
