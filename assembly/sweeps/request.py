"""Definition of a sweep from options, and summary of its results."""

import shlex
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.effects.robot_effects import check_covariates
from forcefit.assembly.exchange.robot_files import load_robot
from forcefit.assembly.kinematics.closing import closing_of
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.linear.reference.pose_error import ASSUMPTIONS
from forcefit.assembly.model.joint_names import row_of
from forcefit.assembly.model.link_stress import stressed_names
from forcefit.assembly.model.robot import Robot
from forcefit.assembly.model.statuses import OK, OUT_OF_REACH
from forcefit.assembly.platform_stiffness.vibration import check_masses
from forcefit.assembly.sweeps.parameters import Design, load_design
from forcefit.assembly.sweeps.plan import Sweep
from forcefit.assembly.sweeps.point_conditions import is_loaded, point_conditions
from forcefit.assembly.sweeps.point_stiffness import STATES
from forcefit.assembly.sweeps.quantities import Question
from forcefit.assembly.sweeps.selection import select
from forcefit.assembly.sweeps.targets import (
    Targets,
    grid_targets,
    of_joints,
    parse_grid,
    parse_values,
    read_targets,
)
from forcefit.inputs.table import BadInput, nearest
from forcefit.stiffness.screws import WRENCH

if TYPE_CHECKING:
    import xarray

    from forcefit.assembly.model.error_distributions import ErrorSources
    from forcefit.assembly.sweeps.netcdf import Stored, StoredDataset

_MODES = 100  # largest accepted number of natural frequencies


@dataclass(frozen=True)
class SweepOptions:
    """Options of :func:`.robot_sweep.sweep`."""

    grid: str | None = None
    poses: Path | str | None = None
    vary: Sequence[str] = ()
    errors: Path | str | None = None
    draws: int | None = None
    seed: int = 1
    assumption: str = "frozen"
    quantities: Sequence[str] = ()
    wrench_of: Sequence[str] = ()
    near: float = 0.02
    yield_strength: float | None = None
    load: Sequence[float] = (0.0,) * 6
    gravity: Sequence[float] = (0.0,) * 3
    under: Mapping[str, float | str] = field(default_factory=dict)
    state: str | None = None
    frequencies: int | None = None
    rest: str | None = None
    mismatch: str | None = None


def ask_sweep(robot: Robot | str | Path, options: SweepOptions) -> Sweep:
    """Return the sweep for given options.

    Args:
        robot: a robot, the path of a robot file, or the name of a built-in robot.
        options: options of the sweep.

    Returns:
        The sweep.

    Raises:
        BadInput: an option, an input file or the robot is invalid.
    """
    close = closing_of(options.rest, options.mismatch, own_errors=not options.errors)
    if close is not None and options.vary:
        option = "--rest" if options.rest is not None else "--mismatch"
        raise BadInput(
            f"{option}: found together with --vary, which replaces the errors "
            f"that {option} computes; expected only one of them"
        )
    if isinstance(robot, Robot):
        if options.vary:
            raise BadInput(
                "--vary: found a robot made in Python; expected a robot file or the "
                "name of a built-in robot"
            )
        machine = robot if close is None else close(robot)
    else:
        machine = load_robot(robot, close)
    check_covariates(machine, options.under)
    _check(options, machine)
    design = None
    if options.vary and not isinstance(robot, Robot):
        design = load_design(robot)
    varied = _vary(design, options.vary) if design is not None else {}
    sources = _sources(options, machine, varied)
    targets = _targets(machine, options.grid, options.poses)
    if options.mismatch is not None and of_joints(targets.names):
        raise BadInput(
            "--mismatch: found points given by drive coordinates, at which the "
            "preload differs from point to point; expected poses, or assembly "
            "solve --joint for one point"
        )
    question = Question(
        machine,
        design=design,
        varied=tuple(varied),
        components=targets.names,
        sources=sources,
        seed=options.seed,
        assumption=None if options.assumption == "none" else options.assumption,
        wrenches=tuple(options.wrench_of),
        near=options.near,
        strength=options.yield_strength,
        load=tuple(options.load),
        gravity=tuple(options.gravity),
        under=dict(options.under),
        stiffness=options.state or "",
        frequencies=options.frequencies or 0,
    )
    if options.quantities:
        question = select(question, options.quantities)
    if question.frequencies:
        check_masses(machine)
    _check_assumption(question)
    command = "" if isinstance(robot, Robot) else _command(robot, options)
    return Sweep(question, targets, tuple(varied.values()), options.draws or 0, command)


def _check(options: SweepOptions, machine: Robot) -> None:
    """Raise an error if an option is invalid."""
    if (options.grid is None) == (options.poses is None):
        raise BadInput("sweep: expected exactly one of --grid and --poses")
    assumption, near = options.assumption, options.near
    strength = options.yield_strength
    if assumption not in (*ASSUMPTIONS, "none"):
        hint = nearest(assumption, [*ASSUMPTIONS, "none"])
        raise BadInput(f'--assumption: found "{assumption[:60]}"{hint}')
    if not 0 <= near <= 1:
        raise BadInput(f"--near: found {near:g}, expected a number from 0 to 1")
    for name in options.wrench_of:
        row_of(machine, name)
    if strength is not None:
        if not 0 < strength < float("inf"):
            raise BadInput(f"--yield-strength: found {strength:g}, expected > 0 Pa")
        if not stressed_names(machine):
            raise BadInput(
                f"--yield-strength: found no link of {machine.name} with a known "
                "shape, so no stress is computed"
            )
    if options.state is not None and options.state not in STATES:
        hint = nearest(options.state, list(STATES))
        raise BadInput(f'--state: found "{options.state[:60]}"{hint}')
    if options.frequencies is not None and not 1 <= options.frequencies <= _MODES:
        raise BadInput(
            f"--frequencies: found {options.frequencies}, expected 1 to {_MODES}"
        )


def _sources(
    options: SweepOptions, machine: Robot, varied: Mapping[str, NDArray]
) -> "ErrorSources | None":
    """Return the distributions of random errors, or None."""
    if (options.errors is None) != (options.draws is None):
        raise BadInput(
            "sweep: found only one of --errors and --draws, expected both or neither"
        )
    if options.errors is None:
        return None
    from forcefit.assembly.model.error_distributions import read_sources

    closing = options.rest is not None or options.mismatch is not None
    fixed = machine.declared_errors if closing else None
    sources = read_sources(options.errors, machine, fixed)
    drawn = [path for path in varied if ".geometric_error." in path]
    if drawn:
        raise BadInput(
            f"--vary {drawn[0]}: found together with --errors, whose draws "
            "replace this number; remove one of the two"
        )
    return sources


def _short(value: float | str) -> str:
    """Format the value of a covariate as on the command line."""
    return value if isinstance(value, str) else f"{value:g}"


def _check_assumption(question: Question) -> None:
    """Raise an error if pose error bounds are requested under load."""
    home = point_conditions(
        question, question.robot, [home_posture(question.robot)], None
    )
    if is_loaded(home) and (question.assumption or question.clearance_only):
        raise BadInput(
            "--assumption: found a loaded robot (--load, --gravity, drive_force or an "
            "effect), but pose error bounds are defined without loads; expected "
            "--assumption none, and no bounds by clearances alone"
        )


def _targets(robot: Robot, grid: str | None, poses: Path | str | None) -> Targets:
    """Return the postures of a grid or of a CSV file."""
    if poses is not None:
        return read_targets(poses, robot)
    return grid_targets(parse_grid(grid or "", robot))


def _vary(design: Design, texts: Sequence[str]) -> dict[str, NDArray]:
    """Return the valid values of each varied parameter by path."""
    values_by_path: dict[str, NDArray] = {}
    owner: dict[str, str] = {}
    for text in texts:
        path, equals, specs = (piece.strip() for piece in text.partition("="))
        if not (equals and specs):
            raise BadInput(
                f'--vary: found "{text[:80]}", expected PATH=VALUE,.. or '
                "PATH=START:STOP:STEP"
            )
        for full in design.find(path):
            if full in owner:
                raise BadInput(f"--vary {path}: {full} is varied twice")
            owner[full] = path
        parts = [parse_values(f"--vary {path}", spec) for spec in specs.split(",")]
        values = np.concatenate(parts)
        if len(np.unique(values)) < len(values):
            raise BadInput(
                f"--vary {path}: found the same value twice, expected different values"
            )
        for value in (float(values.min()), float(values.max())):
            design.check({path: value})
        values_by_path[path] = values
    return values_by_path


def _command(robot: str | Path, options: SweepOptions) -> str:
    """Return the command line, without options that have their default value."""
    default = {option.name: option.default for option in fields(options)}
    given = {name: getattr(options, name) for name in default} | {
        "load": _assigned((name.lower() for name in WRENCH), options.load),
        "gravity": _assigned("xyz", options.gravity),
        "under": ",".join(f"{k}={_short(v)}" for k, v in options.under.items()) or None,
    }
    words = ["forcefit", "assembly", "sweep", str(robot)]
    for key, value in given.items():
        name = "--" + key.replace("_", "-")
        if value is True:
            words.append(name)
        elif isinstance(value, list | tuple):
            words += [word for one in value for word in (name, str(one))]
        elif value not in (None, False) and value != default[key]:
            words += [name, str(value)]
    # A file name may not be valid UTF-8.
    return shlex.join(words).encode(errors="backslashreplace").decode()


def _assigned(names: Iterable[str], values: Iterable[float]) -> str | None:
    """Format nonzero components as on the command line."""
    given = zip(names, values, strict=True)
    return ",".join(f"{name}={value:g}" for name, value in given if value) or None


def summary_of(data: "xarray.Dataset | StoredDataset") -> dict[str, Any]:
    """Summarise a sweep as a dictionary.

    Args:
        data: data set of a sweep.

    Returns:
        Axes, number of points with each status, and for each quantity the minimum, the
        median and the maximum of the finite values.
    """
    status = data.data_vars["status"]
    names, counts = np.unique(status.values.astype(str), return_counts=True)
    sizes = zip(status.dims, status.values.shape, strict=True)
    axes = {str(name): size for name, size in sizes}
    table = {}
    for name, variable in data.data_vars.items():
        if variable.values.dtype.kind == "f":
            table[str(name)] = _spread(variable)
    return {
        **{str(k): v for k, v in data.attrs.items() if k != "coordinates"},
        "axes": axes,
        "points": int(np.prod(list(axes.values()))),
        "status": dict(zip(names.tolist(), counts.tolist(), strict=True)),
        "quantities": table,
    }


def _spread(variable: "xarray.DataArray | Stored") -> dict[str, Any] | None:
    """Return minimum, median and maximum of the finite values, or None."""
    values = variable.values[np.isfinite(variable.values)]
    if not values.size:
        return None
    return {
        "units": variable.attrs.get("units", ""),
        "min": np.min(values), "median": np.median(values), "max": np.max(values),
    }  # fmt: skip


def summary_text(summary: Mapping[str, Any], data: "StoredDataset") -> str:
    """Format the number of points with each status, and a reason for each."""
    lines = [", ".join(f"{name}: {n}" for name, n in summary["status"].items())]
    status = data.data_vars["status"].values.astype(str).ravel()
    for name in summary["status"]:
        if name not in {OK, OUT_OF_REACH} and "reason" in data.data_vars:
            first = int(np.flatnonzero(status == name)[0])
            reasons = data.data_vars["reason"]
            reason = str(reasons.values.ravel()[first])
            own = (
                reason if reason.startswith(name) else f"{name}, for example: {reason}"
            )
            lines.append(own)
    return "\n".join(lines)
