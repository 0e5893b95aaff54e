"""Sweeps in one call, from a robot and varied quantities to a data set.

Start with :func:`sweep`; the command ``forcefit assembly sweep`` has the same options.
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
    """Solve a robot at every posture, design and draw of errors.

    Args:
        robot: a robot, a robot file, or a built-in name.
        grid: grid such as ``tx=-0.2:0.2:0.025,tz=-0.5``; None if ``poses`` is given.
        poses: table of postures; None if ``grid`` is given.
        vary: design parameters, such as ``link_a.link.beam.radius=0.03,0.04``, of a
            robot file or a built-in robot.
        errors: file with the distributions of the errors, see docs/statistics.md.
        draws: number of draws.
        seed: seed of the draws.
        assumption: assumption of problem (27): ``"frozen"``, ``"free"``, ``"budget"``,
            or ``"none"`` if its bounds are not computed.
        quantities: names of the data variables to compute and store; ``"default"``
            stands for those stored if none are named. Some variables are computed only
            if named explicitly: the bounds by clearances without errors
            (``"rotation_error_clearance"``, ``"translation_error_clearance"``) and the
            differences to finite motions (``"linearisation_rotation"``, ..).
        wrench_of: frames whose wrenches are recorded.
        near: distance below which a singularity is reported.
        yield_strength: [Pa] yield strength of the links, for their stress and safety.
        load: load on the platform at its origin in base axes, (6,) [N m, N] or by
            component, ``{"fz": -50}``.
        gravity: (3,) [m/s^2] gravity in base axes.
        under: covariates on which the effects in the robot file depend.
        state: ``"nominal"``, ``"contact"`` or ``"exact"``: state for which K_C and the
            compliance shares of links and joints are computed; None to omit them.
        frequencies: number of natural frequencies.
        rest: frame to which the closures' mismatch at home is added as geometric error.
        mismatch: ``"spring"`` to preload redundant drives that do not fit at home.
        output: NetCDF file to write.  Finished points are stored in
            ``<output>.journal``. After an interruption, the same call resumes from the
            journal and writes the same file, byte for byte.
        progress: callback that receives the numbers of finished points and of all
            points.
        solve: function that solves blocks of points, here or in other processes, see
            :mod:`forcefit.assembly.sweeps.cluster`.

    Returns:
        The data set over the axes, with units. It is in memory even if a file is
        written.

    Raises:
        BadInput: an option, a file named by an option, or the robot violates a rule;
            the journal belongs to another sweep or run; or a file cannot be written.
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
    """Convert the keywords of the last release to options of a sweep.

    Args:
        options: ``reading``, ``play_alone``, ``wrench``, ``linearisation``,
            ``stiffness`` and ``tangent``, and those of :class:`SweepOptions`.

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
