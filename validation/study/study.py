"""Run every check of a study file on its robot.

The file is read by :mod:`forcefit.validation.study.study_file`.  The results are
written by :mod:`forcefit.validation.study.report`.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.effects.robot_effects import (
    apply_robot_effects,
    with_effects_applied,
)
from forcefit.assembly.files.solved_links import solved_link
from forcefit.assembly.kinematics.posture import Posture, place_robot
from forcefit.assembly.linear.energy import Assembly, solve_assembly
from forcefit.assembly.linear.reference.pose_error import ASSUMPTIONS
from forcefit.assembly.model.links import link_compliance
from forcefit.assembly.model.mesh_link import mesh_link_stiffness
from forcefit.assembly.model.robot import BeamLink, Frame, MatrixLink, Robot
from forcefit.assembly.model.statuses import (
    NO_ANSWER,
    NO_EQUILIBRIUM,
    NO_SIGNAL,
    NOT_RUN,
    OK,
    PASSED,
)
from forcefit.assembly.report.first_order import posture_status
from forcefit.assembly.report.platform_stiffness import stiffness_of
from forcefit.assembly.report.pose_errors import pose_error_of
from forcefit.assembly.report.results import solution_of
from forcefit.assembly.sweeps.sweep import sweep_poses
from forcefit.inputs.packages import need
from forcefit.inputs.table import BadInput
from forcefit.results.display import html_table, short_repr
from forcefit.validation.crosscheck.crosscheck import Crosscheck, attempt, crosscheck
from forcefit.validation.crosscheck.verdict import verdict
from forcefit.validation.multibody.simulation import (
    SimulationFailed,
    closing_sequence,
    without_clearance,
)
from forcefit.validation.study.drawn_tolerances import bounds_over_grid, drawn_at_pose
from forcefit.validation.study.governing import governing
from forcefit.validation.study.printed_problems import compare_printed
from forcefit.validation.study.service import at_pose, over_grid
from forcefit.validation.study.study_file import Study

Progress = Callable[[str, int, int], None]
THEORIES = ("euler", "timoshenko")
_PACKAGES = {  # packages that each check requires
    "stiffness": ("pyvista", "pytetwild"),
    "reference": ("cvxpy",),
    "maps": ("xarray", "h5netcdf", "h5py"),
    "crosscheck": ("exudyn",),
}


@dataclass(frozen=True, eq=False)
class StudyResults:
    """Results of a study.  Results that were not requested are None.

    Attributes:
        study: content of the study file.
        robot: robot with the link stiffnesses used in the computations.
        solution: solution at the study's pose, with the keys of ``assembly solve``.
        assembly: assembly of this solution; None if the robot cannot be assembled.
        error: mapping from assumption of problem (27) to bounds, with the keys of
            ``assembly error``.
        reference: result of
            :func:`forcefit.validation.study.printed_problems.compare_printed`.
        stiffness: mapping from frame to K_E of the beam and of the finite elements.
        maps: data set over the grid.
        crosscheck: comparison with the multibody simulation.
        crosscheck_failure: reason why the simulation failed; empty if it did not.
        platform_stiffness: K_C at the pose, with the keys of ``assembly stiffness``.
        governing: bounds of problem (27) with one perfect part, from
            :func:`forcefit.validation.study.governing.governing`.
        service: results for the robot under load, from
            :func:`forcefit.validation.study.service.at_pose`.
        statistics: statistics of parts within tolerance at the pose, with the keys of
            ``assembly statistics``; None for a robot without drawing tolerances.
        draws: data set of the random draws, or None.
        closing: (k, n, 4, 4) poses of the frames while the loops are closed in the
            simulation; None if the simulation failed.
    """

    study: Study
    robot: Robot
    solution: dict[str, Any]
    assembly: Assembly | None
    error: dict[str, Any]
    reference: dict[str, Any] | None
    stiffness: dict[str, dict[str, Any]] | None
    maps: Any
    crosscheck: Crosscheck | None
    crosscheck_failure: str
    closing: NDArray | None
    platform_stiffness: dict[str, Any]
    governing: list[dict[str, Any]]
    service: dict[str, Any] | None = None
    statistics: dict[str, Any] | None = None
    draws: Any = None

    __repr__, _repr_html_ = short_repr, html_table

    @property
    def verdicts(self) -> dict[str, str]:
        """Verdicts of the requested independent checks.

        The verdict is ``"passed"``, ``"failed"`` or ``"not decided"``.  It is ``"no
        signal"`` if there is nothing to compare, and ``"not run"`` without an assembly.
        """
        independent = ("reference", "crosscheck")
        verdicts = {n: NOT_RUN for n in independent if n in self.study.checks}
        if self.reference is not None:
            verdicts["reference"] = self.reference["verdict"]
        if self.crosscheck is not None:
            verdicts["crosscheck"] = verdict(self.crosscheck)
        elif self.crosscheck_failure:
            verdicts["crosscheck"] = NO_ANSWER
        return verdicts

    @property
    def unchecked(self) -> dict[str, str]:
        """Reasons why checks were not possible, by name of the check."""
        silent = "at this pose its errors engage neither springs nor clearances"
        if not self.robot.errors.any():
            silent = "the robot has no geometric errors; [errors] would give it some"
        why = {NOT_RUN: "there is no assembly to check", NO_SIGNAL: silent}
        reasons = {k: why[v] for k, v in self.verdicts.items() if v in why}
        if self.reference is not None and "reason" in self.reference:
            reasons["reference"] = self.reference["reason"]
        if self.crosscheck_failure:
            reasons["crosscheck"] = self.crosscheck_failure
        if self.service is not None and self.service["status"] != OK:
            reasons["service"] = str(self.service.get("reason", NO_EQUILIBRIUM))
        if self.maps is not None and not points_solved(self.maps):
            reasons["maps"] = "none of the grid's points has a solution"
        return reasons

    @property
    def passed(self) -> bool:
        """Whether a certified solution exists and every check passed.

        A check without a signal has not passed if it was requested, or if no other
        check was run.
        """
        verdicts, missing = self.verdicts, self.unchecked
        ran = [v for v in verdicts.values() if v != NO_SIGNAL]
        return (
            self.solution["status"] == OK
            and all(v == PASSED for v in ran)
            and (bool(ran) or not verdicts)
            and not set(missing) & set(self.study.asked)
        )


def run_study(study: Study, progress: Progress = lambda *_: None) -> StudyResults:
    """Run every check of a study.

    Args:
        study: study from :func:`forcefit.validation.study.study_file.read_study`.
        progress: function called with the name of a check, the number of finished steps
            and the number of all steps.

    Returns:
        The results.  No file is written.

    Raises:
        BadInput: the pose is unreachable, a surface cannot be meshed, or an effect of
            the robot loads it or depends on covariates.
        ModuleNotFoundError: a package that a check requires is missing.
    """
    wanted = set(study.checks)
    # Missing packages and unreachable poses are reported before long computations.
    need(*(one for check in sorted(wanted) for one in _PACKAGES.get(check, ())))
    with_effects_applied(place_robot(study.robot, pose=study.pose))
    stiffness, robot = None, study.robot
    if "stiffness" in wanted or study.source == "fea":
        stiffness, robot = _compare_links(study, progress)
    declared = place_robot(robot, pose=study.pose)
    posture = with_effects_applied(declared)
    progress("assembly", 0, 1)
    solution = solution_of(posture) | posture_status(posture)
    solved = solution["status"] == OK
    assembly = solve_assembly(posture) if solved else None
    error = pose_error_of(posture, ASSUMPTIONS)["error"] if solved else None
    progress("assembly", 1, 1)
    reference = None
    if "reference" in wanted and assembly is not None:
        progress("reference", 0, 1)
        reference = compare_printed(posture, assembly, solution["zone"])
        progress("reference", 1, 1)
    maps = None
    if "maps" in wanted:
        maps = sweep_poses(
            robot, study.grid, lambda d, n: progress("maps", d, n), "frozen"
        )
    if maps is not None and study.service is not None:
        maps = over_grid(
            maps, robot, study.service, study.grid,
            lambda d, n: progress("maps at work", d, n),
        )  # fmt: skip
    service = None
    if study.service is not None:
        loads = study.service.load, study.service.gravity
        service = at_pose(
            apply_robot_effects(declared, *loads), study.service, solution
        )
    statistics, draws = None, None
    if study.statistics is not None and solved:
        statistics, draws = drawn_at_pose(
            declared, study.statistics, lambda d, n: progress("drawn parts", d, n)
        )
        if maps is not None and "worst_case" in statistics:
            maps = bounds_over_grid(
                maps, robot, lambda d, n: progress("maps of drawn parts", d, n)
            )
    check, failure, closing = None, {"reason": ""}, None
    if "crosscheck" in wanted and solved:
        progress("cross-check", 0, 1)
        check, failure = attempt(robot.name, lambda: crosscheck(posture, study.scales))
        closing = _closing(posture) if check is not None else None
        progress("cross-check", 1, 1)
    return StudyResults(
        study=study,
        robot=robot,
        solution=solution,
        assembly=assembly,
        error=error or {},
        reference=reference,
        stiffness=stiffness,
        maps=maps,
        crosscheck=check,
        crosscheck_failure=failure.get("reason", ""),
        closing=closing,
        platform_stiffness=stiffness_of(posture),
        governing=governing(posture) if solved else [],
        service=service,
        statistics=statistics,
        draws=draws,
    )


def points_solved(maps: Any) -> int:
    """Return the number of grid points with a solution."""
    return int((maps["status"] == OK).sum())


def _closing(posture: Posture) -> NDArray | None:
    """Return the frame poses while the loops are closed, or None on failure."""
    tight = replace(posture, robot=without_clearance(posture.robot))
    try:
        return closing_sequence(tight)
    except (BadInput, SimulationFailed):
        return None


def _compare_links(
    study: Study, progress: Progress
) -> tuple[dict[str, dict[str, Any]], Robot]:
    """Return K_E by beam theory and finite elements, and the robot of the study."""
    compared: dict[str, dict[str, Any]] = {}
    links: dict[str, MatrixLink] = {}
    for done, (name, mesh) in enumerate(study.meshes.items()):
        progress("finite elements", done, len(study.meshes))
        frame = study.robot.frame(name)
        link = solved_link(replace(frame, link=mesh), study.accuracy)
        solved = mesh_link_stiffness(replace(frame, link=link))
        compared[name] = {
            **_beams(frame),
            "fea": solved.stiffness,
            "relative_error_estimate": solved.relative_error_estimate,
            "mesh": dict(solved.mesh),
        }
        links[name] = MatrixLink(solved.stiffness)
    progress("finite elements", len(study.meshes), len(study.meshes))
    robot = (
        study.robot.with_links(dict(links)) if study.source == "fea" else study.robot
    )
    return compared, robot


def _beams(frame: Frame) -> dict[str, NDArray]:
    """Return K_E of a frame's beam according to both beam theories."""
    assert isinstance(frame.link, BeamLink)
    links = {name: replace(frame.link, theory=name) for name in THEORIES}
    return {
        name: np.linalg.inv(link_compliance(replace(frame, link=link)))
        for name, link in links.items()
    }
