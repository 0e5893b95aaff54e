"""Public names for editors and type checkers, as in ``__init__.py``."""

from forcefit.assembly.exact.exact import solve_exact
from forcefit.assembly.exchange.convert import convert
from forcefit.assembly.exchange.robot_files import load_robot, write_robot
from forcefit.assembly.files.step_file import assemble_in_steps
from forcefit.assembly.kinematics.mobility import mobility
from forcefit.assembly.kinematics.posture import place_robot
from forcefit.assembly.linear.energy import CannotAssemble, solve_assembly
from forcefit.assembly.linear.pose_error import bound_pose_error
from forcefit.assembly.linear.zone import zone_margin
from forcefit.assembly.model.robot import (
    BeamLink,
    Clearance,
    Frame,
    LockedAt,
    MatrixLink,
    Robot,
)
from forcefit.assembly.path.request import errors_along_path
from forcefit.assembly.platform_stiffness.deflection import deflection_curve
from forcefit.assembly.platform_stiffness.platform_stiffness import platform_stiffness
from forcefit.assembly.platform_stiffness.vibration import natural_modes
from forcefit.assembly.statistics.show import show
from forcefit.assembly.statistics.statistics import statistics
from forcefit.assembly.statistics.worst_pose import worst_pose
from forcefit.assembly.steps.bolted import bolt_joints
from forcefit.assembly.sweeps.dataset import open_dataset
from forcefit.assembly.sweeps.point_table import point_table
from forcefit.assembly.sweeps.robot_sweep import sweep
from forcefit.inputs.errors import BadInput
from forcefit.stiffness.beam.beam import beam_compliance
from forcefit.stiffness.fem.fea import mesh_link
from forcefit.validation.assumptions.assumptions import assumption_costs
from forcefit.validation.campaign.campaign_file import read_campaign
from forcefit.validation.correction.compensation import compensate
from forcefit.validation.correction.prediction import predict
from forcefit.validation.crosscheck.crosscheck import crosscheck
from forcefit.validation.diagnosis.diagnose import diagnose
from forcefit.validation.inspection.inspection import inspect_campaign
from forcefit.validation.study.run import run_study

__all__ = [
    "BadInput",
    "BeamLink",
    "CannotAssemble",
    "Clearance",
    "Frame",
    "LockedAt",
    "MatrixLink",
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
    "inspect_campaign",
    "load_robot",
    "mesh_link",
    "mobility",
    "natural_modes",
    "open_dataset",
    "place_robot",
    "platform_stiffness",
    "point_table",
    "predict",
    "read_campaign",
    "run_study",
    "show",
    "solve_assembly",
    "solve_exact",
    "statistics",
    "sweep",
    "worst_pose",
    "write_robot",
    "zone_margin",
    "__version__",
]

__version__: str
