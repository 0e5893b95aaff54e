"""Table of quantities: description, unit, symbol and dimensions of each result.

A quantity has the same name in Python, JSON, NetCDF files and tables.  The records in
:mod:`forcefit.results.outputs` compose the ``--json`` output from these names.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

Kind = Literal["number", "integer", "string", "boolean"]
# labels of the entries along each named dimension of arrays
LABELS: dict[str, tuple[str, ...]] = {
    "screw": ("RX", "RY", "RZ", "TX", "TY", "TZ"),
    "wrench_component": ("MX", "MY", "MZ", "FX", "FY", "FZ"),
    "bound": ("lower", "upper"),
    "axis": ("x", "y", "z"),
    "bounds": ("value", "lower", "upper"),
}
_SCREW, _WRENCH = ("screw",), ("wrench_component",)
_MATRIX = ("screw", "wrench_component")


@dataclass(frozen=True)
class Quantity:
    """Quantity in the results.

    Attributes:
        words: name of the quantity in reports and texts, without an article.
        unit: SI unit.  ``"1"`` denotes a dimensionless number, and ``"rad, m"`` the
            rotations and translations of a screw. The unit is empty if the result
            contains the unit as a separate value.
        dims: names of the dimensions; those in :data:`LABELS` have a fixed length.
        meaning: definition of the quantity, if its name is not sufficient.
        symbol: symbol in the paper; empty if the paper contains no symbol.
        kind: type of the values.
        shown: display unit in texts, if it differs from the SI unit.
        digits: number of significant digits in texts.
    """

    words: str
    unit: str = "1"
    dims: tuple[str, ...] = ()
    meaning: str = ""
    symbol: str = ""
    kind: Kind = "number"
    shown: str = ""
    digits: int = 4

    @property
    def display_unit(self) -> str:
        """Unit used in texts."""
        return self.shown or self.unit

    @property
    def attributes(self) -> dict[str, str]:
        """Attributes of the NetCDF variable that stores this quantity."""
        return {"units": self.unit, "long_name": self.meaning or self.words}


def number(words: str, unit: str = "1", *dims: str) -> Quantity:
    """Return a quantity with floating-point values."""
    return Quantity(words, unit, dims)


def text(words: str, *dims: str, meaning: str = "") -> Quantity:
    """Return a quantity with string values."""
    return Quantity(words, dims=dims, meaning=meaning, kind="string")


def count(words: str, *dims: str, meaning: str = "") -> Quantity:
    """Return a quantity with integer values."""
    return Quantity(words, dims=dims, meaning=meaning, kind="integer")


def flag(words: str, *dims: str) -> Quantity:
    """Return a quantity with boolean values."""
    return Quantity(words, dims=dims, kind="boolean")


QUANTITIES: Mapping[str, Quantity] = {
    # robot, posture, load
    "robot": text("robot"),
    "status": text("status", meaning="ok, or the kind of failure"),
    "reason": text("reason", meaning="explanation of a status other than ok"),
    "remarks": text("note", "remark"),
    "pose": Quantity(
        "pose", "m, rad", meaning="nominal pose of the platform in base axes"
    ),
    "rx": Quantity("rotation vector x", "rad"),
    "ry": Quantity("rotation vector y", "rad"),
    "rz": Quantity("rotation vector z", "rad"),
    "tx": Quantity("position x", "m"),
    "ty": Quantity("position y", "m"),
    "tz": Quantity("position z", "m"),
    "joint_coordinate": Quantity(
        "joint coordinate", "rad or m", ("joint",), "nominal coordinate of each "
        "joint, even if the status is not ok", "q",
    ),
    "nominal_mismatch": Quantity(
        "nominal closure error", meaning="largest closure error [rad or m] of the "
        "nominal robot, due to rounded numbers in its file",
    ),
    "state": text("state", meaning="state of the robot: nominal, contact or exact"),
    "load": Quantity(
        "load", "N m, N", _WRENCH,
        "wrench on the platform, at the platform's origin in base axes", "w"
    ),
    "gravity": Quantity("gravity", "m/s^2", ("axis",), "gravity in base axes", "g"),
    "freedoms": count(
        "degrees of freedom", meaning="degrees of freedom with free drives"
    ),
    "platform_freedoms": count("degrees of freedom of the platform"),
    "freedoms_drives_locked": count("degrees of freedom with locked drives"),
    "platform_freedoms_drives_locked": count(
        "degrees of freedom of the platform with locked drives"
    ),
    "redundant_constraints": count("redundant constraints with locked drives"),
    "drives": count("drives"),
    "locked_freedoms": count("degrees of freedom with locked drives"),
    "overconstraint": count("redundant closure equations"),
    "smallest_singular_value": Quantity(
        "smallest singular value of the constraints", meaning="smallest nonzero "
        "singular value of the constraint matrix, with lengths divided by the robot's "
        "size",
    ),
    "local_freedoms": count(
        "degrees of freedom of the legs",
        meaning="degrees of freedom of the legs with the platform at rest"
    ),
    "actuation_redundancy": count(
        "redundant drives",
        meaning="number of drives minus the degrees of freedom that they lock"
    ),
    "singular_value_gap": Quantity(
        "gap of the singular values", meaning="smallest singular value treated as "
        "nonzero, divided by the largest treated as zero, or by the rounding "
        "error; null if all are treated as zero",
    ),
    "counts_certain": flag("gap of the singular values of at least 100"),
    "singular": flag("more degrees of freedom than at nearby poses"),
    "finite_freedoms": count(
        "degrees of freedom at nearby poses", meaning="degrees of freedom at nearby "
        "poses; 0 if the motions at the pose are only infinitesimal",
    ),
    "words": text("mobility in words"),
    "point": Quantity(
        "point", "m", ("axis",), "reference point of screws and wrenches, in base "
        "axes for a stiffness and in platform axes for a pose error",
    ),
    "direction": Quantity(
        "direction", dims=_SCREW, meaning="unit screw in base axes"
    ),
    "near_singularity": text(
        "nearby singularity", meaning="nearby singularities, with the joints that move",
    ),
    "singular_distance": Quantity(
        "distance from singularity", dims=("kind",),
        meaning="distance from a singularity of each kind: 0 at the singularity, at "
        "most 1",
    ),
    "condition": Quantity(
        "condition number",
        meaning="condition number of the map from drive rates to platform velocity"
    ),
    # quantities of forced assembly, problems (21), (22) and (27) of the paper
    "assemblable": flag("assembles, compliant joints rigid"),
    "assemblable_free": flag("assembles, compliant joints free"),
    "margin": Quantity(
        "zone margin, compliant joints rigid", meaning="factor on all clearances at "
        "which the robot can just be assembled without force, with rigid compliant "
        "joints",
        symbol="lambda",
    ),
    "margin_free": Quantity(
        "zone margin, compliant joints free", meaning="factor on all clearances at "
        "which the robot can just be assembled without force, with compliant joints "
        "free about their own axis",
        symbol="lambda",
    ),
    "margin_bound": Quantity(
        "bound of the zone margin, compliant joints rigid",
        meaning="certified lower bound of the zone margin, compliant joints rigid"
    ),
    "margin_free_bound": Quantity(
        "bound of the zone margin, compliant joints free",
        meaning="certified lower bound of the zone margin, compliant joints free"
    ),
    "energy": Quantity(
        "assembly energy", "J", meaning="minimum elastic energy of the closed robot, "
        "eq. (22)",
        symbol="E", digits=6,
    ),
    "potential": Quantity(
        "potential", "J", meaning="elastic energy minus the work of the loads",
    ),
    "energy_without_clearance": Quantity(
        "energy without clearances", "J",
        meaning="minimum elastic energy of the closed robot with zero clearances",
    ),
    "platform_screw": Quantity(
        "platform error", "rad, m", _SCREW,
        "pose error at the platform's origin, in base axes", "x", shown="mrad, mm"
    ),
    "reading": Quantity(
        "reading", "rad, m", _SCREW, "pose deviation that a measuring device reads",
        shown="mrad, mm"
    ),
    "clearance": Quantity(
        "clearance", "rad, m", _SCREW, "joint displacement within the clearance, and "
        "small motion of a passive joint", "delta c", shown="mrad, mm"
    ),
    "link": Quantity(
        "deformation of the link", "rad, m", _SCREW,
        "deformation of the link, at the frame's origin in its axes", "e",
        shown="mrad, mm"
    ),
    "joint": Quantity(
        "deformation of the joint", "rad, m", _SCREW,
        "deformation of the joint, at the frame's origin in its axes",
        shown="mrad, mm"
    ),
    "geometric_error": Quantity(
        "geometric error", "rad, m", _SCREW,
        "geometric error, at the frame's origin in its axes", "delta l",
        shown="mrad, mm"
    ),
    "wrench": Quantity(
        "wrench", "N m, N", _WRENCH,
        "wrench of the body farther from the base on the nearer body, at the frame's "
        "origin in its axes", "w",
    ),
    "joint_wrench": Quantity(
        "wrench through the joint", "N m, N", _WRENCH,
        "wrench of the body farther from the base on the nearer body, at the frame's "
        "origin in its axes",
    ),
    "start_wrench": Quantity(
        "wrench at the start of the link", "N m, N", _WRENCH,
        "wrench at the start of a link under its own weight, at the frame's origin in "
        "its axes",
    ),
    "closure_wrench": Quantity(
        "wrench of the closure", "N m, N", _WRENCH,
        "wrench that the second chain exerts on the first, at the platform's origin in "
        "base axes",
    ),
    "frames": text("frames", "frame"),
    "closure_residual": Quantity(
        "closure residual",
        meaning="largest closure error, in rad or in reference lengths",
        digits=2
    ),
    "reference_length": Quantity("reference length", "m"),
    "clearance_excess": Quantity(
        "clearance excess", meaning="largest relative excess of a clearance",
        digits=2
    ),
    "duality_gap": Quantity(
        "duality gap", "J", meaning="certified bound of the difference between the "
        "energy and its minimum",
        digits=2
    ),
    "relative_gap": Quantity("relative duality gap", digits=2),
    "screw_rotation": Quantity(
        "certified error of the platform rotation", "rad", shown="mrad",
        digits=2
    ),
    "screw_translation": Quantity(
        "certified error of the platform translation", "m", shown="um",
        digits=2
    ),
    "screw_rotation_open": Quantity(
        "undetermined rotation", "rad",
        meaning="free rotation within the clearances, at the same energy", shown="mrad"
    ),
    "screw_translation_open": Quantity(
        "undetermined translation", "m",
        meaning="free translation within the clearances, at the same energy", shown="um"
    ),
    "screw_rotation_error": Quantity(
        "certified rotation error", "rad",
        meaning="certified error of the platform's rotation, without the undetermined "
        "rotation", shown="mrad",
        digits=2
    ),
    "screw_translation_error": Quantity(
        "certified translation error", "m",
        meaning="certified error of the platform's translation, without the "
        "undetermined translation", shown="um",
        digits=2
    ),
    "stationarity": Quantity(
        "equilibrium residual", meaning="relative residual of the equilibrium", digits=2
    ),
    "iterations": count("iterations"),
    "method": text("method", meaning="numerical method that found the result"),
    "free": count("free motions eliminated"),
    "elastic": count("elastic constraints"),
    "rigid": count("rigid constraints"),
    "redundant": count("redundant constraints"),
    "assumption": text("assumption of problem (27)"),
    "rotation_error": Quantity(
        "largest rotation of the platform", "rad", ("bound",),
        "certified bounds of the largest rotation error, eq. (27)", shown="mrad"
    ),
    "translation_error": Quantity(
        "largest translation of the platform", "m", ("bound",),
        "certified bounds of the largest translation error, eq. (27)", shown="mm"
    ),
    "rotation_error_clearance": Quantity(
        "largest rotation due to clearances", "rad", ("bound",),
        "certified bounds of the largest rotation error, eq. (27), frozen, without "
        "geometric errors", shown="mrad"
    ),
    "translation_error_clearance": Quantity(
        "largest translation due to clearances", "m", ("bound",),
        "certified bounds of the largest translation error, eq. (27), frozen, without "
        "geometric errors", shown="mm"
    ),
    "rotation_screw": Quantity(
        "platform error with the largest rotation", "rad, m", _SCREW,
        "platform error that attains the lower bound of the rotation", shown="mrad, mm"
    ),
    "translation_screw": Quantity(
        "platform error with the largest translation", "rad, m", _SCREW,
        "platform error that attains the lower bound of the translation",
        shown="mrad, mm"
    ),
    "cuts": count("cutting planes"),
    "linearisation_rotation": Quantity(
        "linearisation error, rotation", "rad",
        meaning="magnitude of the platform's rotation, linear minus exact", shown="mrad"
    ),
    "linearisation_translation": Quantity(
        "linearisation error, translation", "m",
        meaning="magnitude of the platform's translation, linear minus exact",
        shown="um",
    ),
    "linearisation_energy": Quantity(
        "linearisation error, relative energy",
        meaning="energy, linear minus exact, relative to the exact one", shown="%"
    ),
    "relative_energy": Quantity("relative energy", shown="%"),
    "stress": Quantity(
        "von Mises stress", "Pa", meaning="largest von Mises stress in the link",
        shown="MPa"
    ),
    "stress_error": Quantity(
        "estimated relative error of the stress", meaning="estimated relative error of "
        "the stress due to the mesh; 0 for beam formulas, infinite for links with a "
        "re-entrant edge without a fillet",
    ),
    "safety": Quantity(
        "safety", meaning="yield strength divided by the largest stress"
    ),
    "rotation": Quantity(
        "platform rotation", "rad", meaning="magnitude of the platform's rotation "
        "error",
        shown="mrad",
    ),
    "translation": Quantity(
        "platform translation", "m", meaning="magnitude of the platform's translation "
        "error",
        shown="um"
    ),
    "rotation_lower": Quantity(
        "bound of the rotation", "rad",
        meaning="certified lower bound of the largest rotation error", shown="mrad"
    ),
    "translation_lower": Quantity(
        "bound of the translation", "m",
        meaning="certified lower bound of the largest translation error", shown="um"
    ),
    "position": Quantity("position error", "m", shown="um"),
    "normalised": Quantity(
        "normalised error", meaning="error divided by the declared noise"
    ),
    "force": Quantity("largest force", "N", meaning="largest force through any body"),
    "moment": Quantity(
        "largest moment", "N m", meaning="largest moment through any body"
    ),
    # quantities of the stiffness of links and of the platform
    "compliance": Quantity(
        "compliance", "rad/(N m) .. m/N", _MATRIX,
        "compliance of the platform in base axes", "C",
    ),
    "stiffness": Quantity(
        "stiffness", "N m/rad .. N/m", ("wrench_component", "screw"),
        "stiffness; null where a free motion makes an entry zero or a constraint makes "
        "it infinite", "K_C",
    ),
    "axis_stiffness": Quantity(
        "stiffness along an axis", "N m/rad, N/m", _WRENCH,
        "stiffness of the platform along each axis while it is free along the others; "
        "0 along a free motion",
    ),
    "free_motions": Quantity(
        "free motions", "rad, m", ("motion", "screw"), "unit screws without resistance"
    ),
    "rigid_wrenches": Quantity(
        "rigid wrenches", "N m, N", ("direction", "wrench_component"),
        "unit wrenches without deformation",
    ),
    "characteristic_length": Quantity("characteristic length", "m"),
    "eigen_stiffness": Quantity(
        "eigenstiffness", "N/m", ("eigen",),
        "eigenstiffnesses in ascending order, with angles multiplied by the "
        "characteristic length",
    ),
    "stiffness_condition": Quantity(
        "condition number of the stiffness",
        meaning="largest divided by smallest eigenstiffness",
    ),
    "pitch": Quantity("pitch", "m/rad"),
    "screw": Quantity("screw", "rad, m", _SCREW),
    "centre": Quantity("centre of stiffness", "m", ("axis",)),
    "share": Quantity(
        "share of a part", dims=("part", "wrench_component"),
        meaning="fraction of each link and joint in the compliance along each axis",
    ),
    "frequency": Quantity(
        "natural frequency", "Hz", ("mode",),
        "natural frequencies, lowest first, with locked drives and without load and "
        "gravity",
    ),
    "idle_motions": count("free motions with the platform at rest"),
    "von_mises": Quantity("largest von Mises stress", "Pa", shown="MPa"),
    "tip": Quantity("tip", "m", ("axis",), "reference point of the stiffness"),
    "base": Quantity("base", "m", ("axis",)),
    "length": Quantity("length", "m"),
    "slenderness": Quantity("slenderness L / r"),
    "relative_error_estimate": Quantity(
        "estimated relative error",
        meaning="largest estimated error of an entry, scaled by sqrt(K_ii K_jj)"
    ),
    "relative_errors": Quantity(
        "estimated relative errors", dims=("row", "column"),
        meaning="estimated errors of the entries, scaled by sqrt(K_ii K_jj)",
    ),
    "stiffness_error": Quantity(
        "estimated error of the stiffness", "N m/rad .. N/m", ("row", "column")
    ),
    "difference": Quantity(
        "difference", dims=("row", "column"),
        meaning="finite elements minus beam, scaled by sqrt(K_ii K_jj) of the beam",
    ),
    "mass": Quantity("mass", "kg"),
    "center_of_mass": Quantity("centre of mass", "m", ("axis",)),
    "inertia": Quantity(
        "inertia", "kg m^2", ("row", "column"), "inertia about the centre of mass"
    ),
    "volume": Quantity("volume", "m^3"),
    "area": Quantity("area", "m^2"),
    "seconds": Quantity("time", "s"),
    "nodes": count("nodes"),
    "elements": count("elements"),
    "unknowns": count("unknowns"),
    "meshes": count("meshes"),
    # quantities of random errors and tolerances
    "draws": count("draws"),
    "assembled": count("draws that assemble"),
    "seed": count("seed"),
    "confidence": Quantity("confidence of all intervals"),
    "probability": Quantity("probability"),
    "lower": Quantity("lower bound of the interval"),
    "upper": Quantity("upper bound of the interval"),
    "undecided": count("undecided draws"),
    "limit": Quantity("limit", ""),
    "unit": text("unit"),
    "contact_length": Quantity("contact length", "m"),
    "free_motion": Quantity(
        "free motion", "rad, m", _SCREW,
        "unit screw of a platform motion without resistance; NaN if there is none",
    ),
    "clearance_mixed": Quantity(
        "clearance mixed",
        meaning="1 if the random walk within the clearances has mixed, otherwise 0"
    ),
    "yield": Quantity("yield"),
    "price": Quantity("price of the tolerances"),
    "tolerance": Quantity("tolerance", "rad or m"),
    "first_index": Quantity(
        "first-order Sobol index", dims=("bounds",),
        meaning="fraction of the variance due to a group of errors alone",
    ),
    "total_index": Quantity(
        "total Sobol index", dims=("bounds",),
        meaning="fraction of the variance due to a group, with its interactions",
    ),
    "failed_share": Quantity(
        "share left out", meaning="fraction of the base draws that are omitted because "
        "a compared draw has no result",
    ),
    "part": Quantity(
        "deviation of the platform", "rad, m", ("component",),
        "standard deviation of the platform's rotation and translation due to a group",
    ),
    "gain": Quantity(
        "slope of the platform", "rad or m for each rad or m", ("component",),
        "derivative of the platform's rotation and translation with respect to a group "
        "of errors; NaN if the group contains both angles and lengths",
    ),
    "rank": count("possible ranks", "bound"),
    "postures": count("postures"),
    "grid": text("grid"),
    # paths
    "time": Quantity("time", "s"),
    "joint_velocity": Quantity(
        "joint velocity", "rad/s or m/s", ("joint",), "rate of every joint coordinate"
    ),
    "joint_acceleration": Quantity(
        "joint acceleration", "rad/s^2 or m/s^2", ("joint",),
        "second derivative of every joint coordinate",
    ),
    "platform_velocity": Quantity(
        "platform velocity", "rad/s, m/s", _SCREW,
        "velocity of the platform at its origin, in base axes"
    ),
    "platform_acceleration": Quantity(
        "platform acceleration", "rad/s^2, m/s^2", _SCREW,
        "acceleration of the platform at its origin, in base axes",
    ),
    "inertial_screw": Quantity(
        "deflection due to acceleration", "rad, m", _SCREW, "change of the pose error "
        "due to accelerations, at the platform's origin in base axes", shown="mrad, mm"
    ),
    "drive_force": Quantity(
        "drive force", "N m or N", ("drive",),
        "force or moment that each drive exerts on the body that it moves",
    ),
    "first_frequency": Quantity(
        "first natural frequency", "Hz",
        meaning="lowest natural frequency along the path, with locked drives and "
        "without load and gravity",
    ),
    "periods": Quantity(
        "path time in periods",
        meaning="path time multiplied by the first natural frequency",
    ),
    # quantities of measured data and comparisons
    "campaign": text("campaign"),
    "rows": count("rows"),
    "verdict": text("verdict"),
    "passed": flag("passed"),
    "crosscheck": text("cross-check"),
    "worst_clearance": text("certified worst case"),
    "before": Quantity("before", ""),
    "after": Quantity("after", ""),
    "std": Quantity("standard deviation", ""),
    "value": Quantity("value", ""),
    "name": text("name"),
    "names": text("names", "name"),
    "where": text("frames", "frame"),
    "registration": text("registration"),
    "reference_point": Quantity(
        "reference point", "m", ("axis",), "reference point in platform axes"
    ),
    "not_measured": text("components not measured", "component"),
    "beyond_learned_range": text("rows outside the learned range", "row"),
    "rms": Quantity("root mean square"),
    "scatter": Quantity("scatter about the declared robot", "m", shown="um"),
    "left_out": text("left out", "row"),
    "slope": Quantity("slope of the difference with the scale"),
    "scale": Quantity("scale of errors and loads"),
    "accuracy": Quantity("accuracy", "m", shown="um"),
    "repeatability": Quantity("repeatability", "m", shown="um"),
}  # fmt: skip


def in_words(key: str) -> str:
    """Return the name of a quantity in words, or the key if it is not in the table."""
    return QUANTITIES[key].words if key in QUANTITIES else key.replace("_", " ")


def unit_of(key: str) -> str:
    """Return the SI unit of a key; empty if dimensionless, mixed or unknown."""
    unit = QUANTITIES[key].unit if key in QUANTITIES else ""
    mixed = unit == "1" or "," in unit or ".." in unit or " or " in unit
    return "" if mixed else unit
