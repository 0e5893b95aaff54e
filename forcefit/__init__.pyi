"""Public names for editors and type checkers, as in ``__init__.py``."""

from assembly.exact.exact import solve_exact
from assembly.exchange.convert import convert
from assembly.exchange.robot_files import load_robot, write_robot
from assembly.files.step_file import read_steps
from assembly.kinematics.mobility import mobility
from assembly.kinematics.posture import place_robot
from assembly.linear.energy import CannotAssemble, solve_assembly
from assembly.linear.pose_error import bound_pose_error
from assembly.linear.zone import zone_margin
from assembly.model.error_distributions import read_sources
from assembly.model.robot import BeamLink, Clearance, Frame, LockedAt, MatrixLink, Robot
from assembly.path.request import PathTimes, errors_along_path
from assembly.platform_stiffness.deflection import deflection_curve
from assembly.platform_stiffness.platform_stiffness import platform_stiffness
from assembly.platform_stiffness.vibration import natural_modes
from assembly.report.show import show
from assembly.statistics.experiment import Experiment
from assembly.statistics.monte_carlo import run_draws
from assembly.statistics.summary import summarise
from assembly.steps.bolted import bolt_joints
from assembly.steps.run import assemble_in_steps
from assembly.sweeps.dataset import open_dataset
from assembly.sweeps.maps import figure_of
from assembly.sweeps.point_table import point_table
from assembly.sweeps.robot_sweep import sweep
from forcefit.inputs.errors import BadInput
from stiffness.beam.beam import beam_compliance
from stiffness.beam.sections import rectangular_section, round_section
from stiffness.fem.fea import mesh_link
from stiffness.fem.material import Material
from stiffness.surface.interface import parse_interface
from validation.assumptions.assumptions import assumption_costs
from validation.campaign.campaign_file import read_campaign, read_commands
from validation.correction.compensation import compensate
from validation.correction.prediction import predict
from validation.crosscheck.crosscheck import crosscheck
from validation.diagnosis.diagnose import diagnose
from validation.inspection.inspection import inspect_campaign
from validation.study.report import write_study
from validation.study.study import run_study
from validation.study.study_file import read_study

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
    "summarise",
    "sweep",
    "write_robot",
    "write_study",
    "zone_margin",
    "__version__",
]

__version__: str
