"""Public names for editors and type checkers, as in ``__init__.py``."""

from assembly.exact.exact import solve_exact
from assembly.exchange.convert import convert
from assembly.exchange.robot_files import load_robot, write_robot
from assembly.kinematics.closing import preloaded, rest_in
from assembly.kinematics.mobility import mobility
from assembly.kinematics.posture import Posture, home_posture, place_robot
from assembly.kinematics.singular_posture import is_singular
from assembly.linear.energy import Assembly, CannotAssemble, solve_assembly
from assembly.linear.pose_error import PoseError, bound_pose_error
from assembly.linear.zone import zone_margin
from assembly.model.error_distributions import read_sources
from assembly.model.random_errors import draw_errors
from assembly.model.robot import BeamLink, Clearance, Frame, MatrixLink, Robot
from assembly.platform_stiffness.deflection import deflection_curve
from assembly.platform_stiffness.matrices import PlatformStiffness
from assembly.platform_stiffness.platform_stiffness import platform_stiffness
from assembly.platform_stiffness.vibration import natural_modes
from assembly.statistics.allocation import allocate
from assembly.statistics.experiment import Experiment
from assembly.statistics.monte_carlo import run_draws
from assembly.statistics.summary import summarise
from assembly.sweeps.dataset import open_dataset
from assembly.sweeps.maps import figure_of
from assembly.sweeps.point_table import point_table
from assembly.sweeps.robot_sweep import sweep
from forcefit.inputs.errors import BadInput
from stiffness.beam.beam import beam_compliance
from stiffness.beam.sections import Section, rectangular_section, round_section
from stiffness.fem.fea import FemOptions, mesh_link
from stiffness.fem.material import Material
from stiffness.link import LinkStiffness, turn_link
from stiffness.report.library import look_up, read_library
from stiffness.report.library_build import build_library
from stiffness.surface.interface import Interface, parse_interface
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
    "Assembly",
    "BadInput",
    "BeamLink",
    "CannotAssemble",
    "Clearance",
    "Experiment",
    "FemOptions",
    "Frame",
    "Interface",
    "LinkStiffness",
    "Material",
    "MatrixLink",
    "PlatformStiffness",
    "PoseError",
    "Posture",
    "Robot",
    "Section",
    "allocate",
    "assumption_costs",
    "beam_compliance",
    "bound_pose_error",
    "build_library",
    "compensate",
    "convert",
    "crosscheck",
    "deflection_curve",
    "diagnose",
    "draw_errors",
    "figure_of",
    "home_posture",
    "inspect_campaign",
    "is_singular",
    "load_robot",
    "look_up",
    "mesh_link",
    "mobility",
    "natural_modes",
    "open_dataset",
    "parse_interface",
    "place_robot",
    "platform_stiffness",
    "point_table",
    "predict",
    "preloaded",
    "read_campaign",
    "read_commands",
    "read_library",
    "read_sources",
    "read_study",
    "rectangular_section",
    "rest_in",
    "round_section",
    "run_draws",
    "run_study",
    "solve_assembly",
    "solve_exact",
    "summarise",
    "sweep",
    "turn_link",
    "write_robot",
    "write_study",
    "zone_margin",
    "__version__",
]

__version__: str
