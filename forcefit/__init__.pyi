"""Public names for editors and type checkers, as in ``__init__.py``."""

from forcefit.assembly.exact.exact import solve_exact
from forcefit.assembly.exchange.convert import convert
from forcefit.assembly.exchange.robot_files import load_robot, write_robot
from forcefit.assembly.files.step_file import read_steps
from forcefit.assembly.kinematics.mobility import mobility
from forcefit.assembly.kinematics.posture import place_robot
from forcefit.assembly.linear.energy import CannotAssemble, solve_assembly
from forcefit.assembly.linear.pose_error import bound_pose_error
from forcefit.assembly.linear.zone import zone_margin
from forcefit.assembly.model.error_distributions import read_sources
from forcefit.assembly.model.robot import (
    BeamLink,
    Clearance,
    Frame,
    LockedAt,
    MatrixLink,
    Robot,
)
from forcefit.assembly.path.request import PathTimes, errors_along_path
from forcefit.assembly.platform_stiffness.deflection import deflection_curve
from forcefit.assembly.platform_stiffness.platform_stiffness import platform_stiffness
from forcefit.assembly.platform_stiffness.vibration import natural_modes
from forcefit.assembly.report.show import show
from forcefit.assembly.statistics.callout_sources import sources_of
from forcefit.assembly.statistics.experiment import Experiment
from forcefit.assembly.statistics.monte_carlo import run_draws
from forcefit.assembly.statistics.summary import summarise
from forcefit.assembly.statistics.worst_pose import worst_pose
from forcefit.assembly.steps.bolted import bolt_joints
from forcefit.assembly.steps.run import assemble_in_steps
from forcefit.assembly.sweeps.dataset import open_dataset
from forcefit.assembly.sweeps.maps import figure_of
from forcefit.assembly.sweeps.point_table import point_table
from forcefit.assembly.sweeps.robot_sweep import sweep
from forcefit.inputs.errors import BadInput
from forcefit.stiffness.beam.beam import beam_compliance
from forcefit.stiffness.beam.sections import rectangular_section, round_section
from forcefit.stiffness.fem.fea import mesh_link
from forcefit.stiffness.fem.material import Material
from forcefit.stiffness.surface.interface import parse_interface
from forcefit.validation.assumptions.assumptions import assumption_costs
from forcefit.validation.campaign.campaign_file import read_campaign, read_commands
from forcefit.validation.correction.compensation import compensate
from forcefit.validation.correction.prediction import predict
from forcefit.validation.crosscheck.crosscheck import crosscheck
from forcefit.validation.diagnosis.diagnose import diagnose
from forcefit.validation.inspection.inspection import inspect_campaign
from forcefit.validation.study.report import write_study
from forcefit.validation.study.study import run_study
from forcefit.validation.study.study_file import read_study

__all__ = [
    "BadInput",
    "BeamLink",
    "CannotAssemble",
    "Clearance",
    "Experiment",
    "Frame",
    "LockedAt",
    "Material",
    "MatrixLink",
    "PathTimes",
    "Robot",
    "assemble_in_steps",
    "assumption_costs",
    "beam_compliance",
    "bolt_joints",
    "bound_pose_error",
    "compensate",
    "convert",
    "crosscheck",
    "deflection_curve",
    "diagnose",
    "errors_along_path",
    "figure_of",
    "inspect_campaign",
    "load_robot",
    "mesh_link",
    "mobility",
    "natural_modes",
    "open_dataset",
    "parse_interface",
    "place_robot",
    "platform_stiffness",
    "point_table",
    "predict",
    "read_campaign",
    "read_commands",
    "read_sources",
    "read_steps",
    "read_study",
    "rectangular_section",
    "round_section",
    "run_draws",
    "run_study",
    "show",
    "solve_assembly",
    "solve_exact",
    "sources_of",
    "summarise",
    "sweep",
    "worst_pose",
    "write_robot",
    "write_study",
    "zone_margin",
    "__version__",
]

__version__: str
