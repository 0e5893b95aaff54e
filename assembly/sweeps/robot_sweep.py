"""Sweep of a robot in one call.

The arguments of :func:`sweep` correspond to the options of the command ``forcefit
assembly sweep``.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from forcefit.assembly.model.given_load import Load, one_load
from forcefit.assembly.model.robot import Robot
from forcefit.assembly.sweeps.dataset import open_dataset
from forcefit.assembly.sweeps.request import SweepOptions, ask_sweep
from forcefit.assembly.sweeps.selection import BY_CLEARANCE, DEFAULT, FINITE
from forcefit.assembly.sweeps.sweep import (
    Progress,
    Solver,
    run_sweep,
    solve_here,
    sweep_in_memory,
)

if TYPE_CHECKING:
    import xarray


def sweep(
    robot: Robot | Path | str,
    *,
    grid: str | None = None,
    poses: Path | str | None = None,
    vary: Sequence[str] = (),
    errors: Path | str | None = None,
    draws: int | None = None,
    seed: int = 1,
    assumption: str = "frozen",
    quantities: Sequence[str] = (),
    wrench_of: Sequence[str] = (),
    near: float = 0.02,
    yield_strength: float | None = None,
    load: Load = (0.0,) * 6,
    gravity: Sequence[float] = (0.0,) * 3,
    under: Mapping[str, float | str] | None = None,
    state: str | None = None,
    frequencies: int | None = None,
    rest: str | None = None,
    mismatch: str | None = None,
    output: Path | str | None = None,
    progress: Progress = lambda done, total: None,
    solve: Solver = solve_here,
) -> "xarray.Dataset":
    """Solve a robot for all postures, design parameters and random errors.

    Args:
        robot: a robot, the path of a robot file, or the name of a built-in robot.
        grid: grid of postures such as ``tx=-0.2:0.2:0.025,tz=-0.5``; None if ``poses``
            is given.
        poses: path of a CSV file with postures; None if ``grid`` is given.
        vary: design parameters with their values, such as
            ``link_a.link.beam.radius=0.03,0.04``.
        errors: path of a file with error distributions, see docs/statistics.md.
        draws: number of random draws of errors.
        seed: seed of the random errors.
        assumption: assumption of problem (27): ``"frozen"``, ``"free"``, ``"budget"``,
            or ``"none"`` to omit pose error bounds.
        quantities: names of the variables to compute and store. ``"default"`` selects
            the variables that are stored without this argument. Further variables are
            the pose error bounds without geometric errors
            (``"rotation_error_clearance"``, ``"translation_error_clearance"``) and the
            differences between the linear and the exact solution
            (``"linearisation_rotation"``, ..).
        wrench_of: frames whose wrenches are stored.
        near: distance below which a nearby singularity is reported.
        yield_strength: [Pa] yield strength of the links, for stress and safety.
        load: load on the platform at its origin in base axes, (6,) [N m, N] or a
            dictionary such as ``{"fz": -50}``.
        gravity: (3,) [m/s^2] gravity in base axes.
        under: covariates of the effects in the robot file.
        state: state in which the platform stiffness K_C is computed: ``"nominal"``,
            ``"contact"`` or ``"exact"``; None to omit it.
        frequencies: number of natural frequencies.
        rest: frame whose geometric error compensates the closure error in the home
            pose.
        mismatch: ``"spring"`` to preload redundant drives by the closure error in the
            home pose.
        output: NetCDF file to write. An interrupted sweep resumes from the points in
            ``<output>.journal``. The file does not depend on interruptions.
        progress: function called with the number of finished points and the number of
            all points.
        solve: function that solves blocks of points, for example on a cluster, see
            :mod:`forcefit.assembly.sweeps.cluster`.

    Returns:
        The data set, in memory.

    Raises:
        BadInput: an argument, an input file or the robot is invalid; the journal
            belongs to another sweep or is used by another process; or a file cannot be
            written.
    """
    if isinstance(quantities, str):
        quantities = (quantities,)
    asked = ask_sweep(
        robot,
        SweepOptions(
            grid=grid, poses=poses, vary=vary, errors=errors, draws=draws, seed=seed,
            assumption=assumption, quantities=quantities, wrench_of=wrench_of,
            near=near, yield_strength=yield_strength, load=one_load(load).tolist(),
            gravity=gravity, under=under or {}, state=state, frequencies=frequencies,
            rest=rest, mismatch=mismatch,
        ),
    )  # fmt: skip
    if output is None:
        return sweep_in_memory(asked, progress)
    run_sweep(asked, output, progress, solve)
    return open_dataset(output)


def options_by_old_names(**options: Any) -> SweepOptions:
    """Convert keywords of an older release to options of a sweep.

    Args:
        options: ``reading``, ``play_alone``, ``wrench``, ``linearisation``,
            ``stiffness`` and ``tangent``, and all options of :class:`SweepOptions`.

    Returns:
        The options.
    """
    state = options.pop("tangent", None)
    if options.pop("stiffness", False):
        state = state or "nominal"
    if state is not None:
        options["state"] = state
    for old, new in (("reading", "assumption"), ("wrench", "wrench_of")):
        if old in options:
            options[new] = options.pop(old)
    added = [
        name
        for old, names in (("play_alone", BY_CLEARANCE), ("linearisation", FINITE))
        if options.pop(old, False)
        for name in names
    ]
    if added:
        options["quantities"] = (DEFAULT, *added)
    return SweepOptions(**options)
