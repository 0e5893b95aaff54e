"""forcefit: forced assembly of parallel manipulators, with independent checks.

To load a robot, call ``import forcefit as ff; ff.load_robot("irsbot2")``.  Public names
are imported on first use.  :mod:`forcefit.inputs` reads and checks files, and
:mod:`forcefit.commands` implements the command line.
"""

import os.path
import sys

# In a checkout without symbolic links, for example on Windows, the packages are found
# in the parent folder.
if not os.path.isdir(os.path.join(__path__[0], "assembly")):
    __path__.append(os.path.dirname(__path__[0]))
from forcefit.old_packages import OldPackages

if not any(isinstance(finder, OldPackages) for finder in sys.meta_path):
    sys.meta_path.insert(0, OldPackages())

TYPE_CHECKING = False  # avoids importing typing, which is slow
if TYPE_CHECKING:
    __version__: str

# the complete public interface: public names, grouped by the module that defines them
_OWNERS = {
    "forcefit.inputs.errors": ("BadInput",),
    "forcefit.stiffness.beam.beam": ("beam_compliance",),
    "forcefit.stiffness.fem.fea": ("mesh_link",),
    "forcefit.assembly.exact.exact": ("solve_exact",),
    "forcefit.assembly.exchange.convert": ("convert",),
    "forcefit.assembly.exchange.robot_files": ("load_robot", "write_robot"),
    "forcefit.assembly.kinematics.posture": ("place_robot",),
    "forcefit.assembly.linear.energy": ("CannotAssemble", "solve_assembly"),
    "forcefit.assembly.kinematics.mobility": ("mobility",),
    "forcefit.assembly.linear.pose_error": ("bound_pose_error",),
    "forcefit.assembly.linear.zone": ("zone_margin",),
    "forcefit.assembly.path.request": ("errors_along_path",),
    "forcefit.assembly.platform_stiffness.deflection": ("deflection_curve",),
    "forcefit.assembly.platform_stiffness.platform_stiffness": ("platform_stiffness",),
    "forcefit.assembly.platform_stiffness.vibration": ("natural_modes",),
    "forcefit.assembly.model.robot": (
        "BeamLink", "Clearance", "Frame", "LockedAt", "MatrixLink", "Robot",
    ),
    "forcefit.assembly.files.step_file": ("assemble_in_steps",),
    "forcefit.assembly.steps.bolted": ("bolt_joints",),
    "forcefit.assembly.statistics.show": ("show",),
    "forcefit.assembly.statistics.statistics": ("statistics",),
    "forcefit.assembly.statistics.worst_pose": ("worst_pose",),
    "forcefit.assembly.sweeps.dataset": ("open_dataset",),
    "forcefit.assembly.sweeps.point_table": ("point_table",),
    "forcefit.assembly.sweeps.robot_sweep": ("sweep",),
    "forcefit.validation.assumptions.assumptions": ("assumption_costs",),
    "forcefit.validation.campaign.campaign_file": ("read_campaign",),
    "forcefit.validation.correction.compensation": ("compensate",),
    "forcefit.validation.correction.prediction": ("predict",),
    "forcefit.validation.crosscheck.crosscheck": ("crosscheck",),
    "forcefit.validation.diagnosis.diagnose": ("diagnose",),
    "forcefit.validation.inspection.inspection": ("inspect_campaign",),
    "forcefit.validation.study.run": ("run_study",),
}  # fmt: skip
# Deprecated public names, grouped by the module that still defines them, each with its
# replacement.  They are supported for one more release.
_REPLACED = {
    "forcefit.stiffness.beam.sections": {
        "rectangular_section": "beam_compliance", "round_section": "beam_compliance",
    },
    "forcefit.stiffness.fem.material": {"Material": "mesh_link"},
    "forcefit.stiffness.surface.interface": {"parse_interface": "mesh_link"},
    "forcefit.assembly.files.step_file": {"read_steps": "assemble_in_steps"},
    "forcefit.assembly.kinematics.posture": {"home_posture": "place_robot"},
    "forcefit.assembly.model.error_distributions": {"read_sources": "statistics"},
    "forcefit.assembly.path.request": {"PathTimes": "errors_along_path"},
    "forcefit.assembly.statistics.callout_sources": {"sources_of": "statistics"},
    "forcefit.assembly.statistics.experiment": {"Experiment": "statistics"},
    "forcefit.assembly.statistics.monte_carlo": {"run_draws": "statistics"},
    "forcefit.assembly.statistics.summary": {"summarise": "statistics"},
    "forcefit.assembly.sweeps.maps": {"figure_of": "show"},
    "forcefit.assembly.sweeps.request": {"ask_sweep": "sweep"},
    "forcefit.assembly.sweeps.sweep": {
        "run_sweep": "sweep", "sweep_in_memory": "sweep",
    },
    "forcefit.validation.campaign.campaign_file": {"read_commands": "read_campaign"},
    "forcefit.validation.study.report": {"write_study": "run_study"},
    "forcefit.validation.study.study_file": {"read_study": "run_study"},
}  # fmt: skip
# Deprecated public names, supported for one more release.  Each entry gives the new
# public name, followed by the module and attribute if they differ from those of the new
# name.
_RENAMED: dict[str, tuple[str, ...]] = {
    "foretell": ("predict",), "load_deflection": ("deflection_curve",),
    "read_robot": ("load_robot",),
    "SweepOptions": ("sweep", "forcefit.assembly.sweeps.robot_sweep",
                     "options_by_old_names"),
    **{old: (new, owner, old)
       for owner, names in _REPLACED.items() for old, new in names.items()},
}  # fmt: skip
# names that were public in the last release and must now be imported from their modules
_MOVED = {
    "forcefit.stiffness.beam.sections": ("Section",),
    "forcefit.stiffness.fem.fea": ("FemOptions",),
    "forcefit.stiffness.link": ("LinkStiffness", "turn_link"),
    "forcefit.stiffness.report.library": ("look_up", "read_library"),
    "forcefit.stiffness.report.library_build": ("build_library",),
    "forcefit.stiffness.surface.interface": ("Interface",),
    "forcefit.assembly.kinematics.closing": ("preloaded", "rest_in"),
    "forcefit.assembly.kinematics.posture": ("Posture",),
    "forcefit.assembly.kinematics.singular_posture": ("is_singular",),
    "forcefit.assembly.linear.energy": ("Assembly",),
    "forcefit.assembly.linear.pose_error": ("PoseError",),
    "forcefit.assembly.model.random_errors": ("draw_errors",),
    "forcefit.assembly.platform_stiffness.matrices": ("PlatformStiffness",),
    "forcefit.assembly.statistics.allocation": ("allocate",),
}
_OWNER_OF = {name: owner for owner, names in _OWNERS.items() for name in names}
_MOVED_TO = {name: owner for owner, names in _MOVED.items() for name in names}
__all__ = [*sorted(_OWNER_OF), "__version__"]


def __getattr__(name: str) -> object:
    """Import a public name on first use; warn if the name is deprecated."""
    if name == "__version__":
        return _version()
    if name not in _OWNER_OF and name not in _RENAMED and name not in _MOVED_TO:
        raise AttributeError(f"module 'forcefit' has no attribute {name!r}")
    from importlib import import_module

    if name in _OWNER_OF:
        return getattr(import_module(_OWNER_OF[name]), name)
    from warnings import warn

    if name in _MOVED_TO:
        owner = _MOVED_TO[name]
        warn(f"forcefit.{name} is now {owner}.{name}", FutureWarning, stacklevel=2)
        return getattr(import_module(owner), name)
    new, *place = _RENAMED[name]
    warn(f"forcefit.{name} is now forcefit.{new}", FutureWarning, stacklevel=2)
    owner, attribute = place or (_OWNER_OF[new], new)
    return getattr(import_module(owner), attribute)


def __dir__() -> list[str]:
    """Return the public names only."""
    return __all__


def _version() -> str:
    """Return the package version: the last tag and the number of commits since then."""
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("forcefit")
    except PackageNotFoundError:
        return "0+not.installed"
