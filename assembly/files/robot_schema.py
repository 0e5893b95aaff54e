"""JSON schema of robot files, for completion and validation in text editors."""

from forcefit.assembly.callouts.callout import HELD, LOCATIONS, ORIENTATIONS, SHAPES
from forcefit.assembly.callouts.zone import DISTRIBUTIONS
from forcefit.assembly.drawing.drawing import FREE_ROWS
from forcefit.assembly.effects import LIBRARY
from forcefit.assembly.effects.forms import FORMS
from forcefit.assembly.effects.functions import FORMULA
from forcefit.assembly.files.function_file import FUNCTION
from forcefit.assembly.model.frame import LEFT
from forcefit.assembly.model.function import KINDS
from forcefit.assembly.model.robot import JOINTS
from forcefit.results.quantities import count, flag, number, text
from forcefit.results.records import (
    Anything,
    Each,
    Either,
    Listed,
    WithUnits,
    Words,
    record,
)
from forcefit.stiffness.surface.surface import UNITS

_DIRECTION = number("direction", "1", "axis")
_POINT = number("point", "m", "axis")
_INERTIA = number(
    "Ixx, Iyy, Izz, Ixy, Ixz, Iyz about the centre of mass", "kg m^2", "moment"
)
_INTERFACE = Either((
    text('interface, such as "z=0.452"'),
    record(
        plane=record(point=_POINT, normal=_DIRECTION),
        radius_=number("radius", "m"),
    ),
    record(bore=record(point=_POINT, axis=_DIRECTION, radius=number("radius", "m"))),
))  # fmt: skip
_BEAM = record(
    theory_=Words(("timoshenko", "euler")), length_=number("length", "m"),
    axis_=number("axis in the axes of this frame", "1", "axis"),
    up_=number("direction of the height in the axes of this frame", "1", "axis"),
    radius_=number("radius", "m"), inner_radius_=number("inner radius", "m"),
    width_=number("width", "m"), height_=number("height", "m"),
    area_=number("area", "m^2"),
    I_y_=number("second moment of area for bending about y", "m^4"),
    I_z_=number("second moment of area for bending about z", "m^4"),
    J_=number("torsion constant", "m^4"),
    shear_y_=number("shear factor for a force along y"),
    shear_z_=number("shear factor for a force along z"),
)  # fmt: skip
_MESH = record(
    surface=text("file of the surface: STL, OBJ, PLY, VTK, MSH or STEP"),
    base=_INTERFACE, tip=_INTERFACE, unit_=Words((*UNITS,)),
    up_=number('direction "up" of the frame in mesh axes', "1", "axis"),
    axis_=number("direction from base to tip in the axes of this frame", "1", "axis"),
    interface_=Words(("rigid", "distributing")),
)  # fmt: skip
_STIFFNESS = number("stiffness", "N m/rad .. N/m", "screw", "wrench_component")
_LINK = record(
    beam_=_BEAM, mesh_=_MESH, stiffness_=_STIFFNESS,
    library_=text("entry of a stiffness library: path#key"),
    model_=Each(Either((
        number("value for a link model of another distribution", ""),
        text("name of the model, and values"),
    ))),
    young_=number("Young's modulus", "Pa"), poisson_=number("Poisson's ratio"),
    density_=number("density", "kg/m^3"), up_=_DIRECTION,
    pieces_=number("number of springs in series for a beam"),
    parts_=text("solids made of other materials", "part"),
)  # fmt: skip
_LOCKED_AT = Either((
    Words(("home",)),
    record(pose_=Each(number("pose of the platform", "m, rad")),
           joints_=Each(number("coordinate of a drive", "rad or m")),
           left_=Words(LEFT)),
))  # fmt: skip
_FIT = text('ISO 286 fit instead of "radial", such as "12 H7/g6"')
_CLEARANCE = record(
    radial_=number("radial clearance", "m"), axial_=number("axial clearance", "m"),
    tilt_=number("tilt clearance", "rad"), spin_=number("clearance about z", "rad"),
    ball_=number("clearance between ball and socket", "m"),
    fit_=_FIT,
    length_=number("length of the bore, or distance between two bearings", "m"),
    parts_=text("common name of the hole and shaft of a fit"),
    bound_=Words(("tilt", "spin")),
)  # fmt: skip
_FRAME = record(
    name=text("name"), parent=text('name of a frame, or "base"'),
    translation_=number("translation from the parent", "m", "axis"),
    rotation_=number("rotation vector from the parent", "rad", "axis"),
    dh_=record(
        theta_=number("Denavit-Hartenberg theta", "rad"),
        d_=number("Denavit-Hartenberg d", "m"), a_=number("Denavit-Hartenberg a", "m"),
        alpha_=number("Denavit-Hartenberg alpha", "rad"),
    ),
    joint_=Words((*JOINTS,)), actuated_=flag("actuated"),
    pitch_=number("translation of a helical joint per turn", "m"),
    position_=number("coordinate in the home pose", "rad or m"),
    limits_=number("minimum and maximum coordinate", "rad or m", "bound"),
    geometric_error_="geometric_error",
    tolerance_=number("standard deviations of the geometric error", "rad, m", "screw"),
    clearance_=_CLEARANCE,
    locked_at_=_LOCKED_AT,
    joint_stiffness_=Either((
        number("diagonal stiffness", "N m/rad .. N/m", "screw"), _STIFFNESS,
    )),
    drive_force_=number("drive force on a passive joint", "N m or N"),
    link_=_LINK, up_=_DIRECTION, mass_=number("mass", "kg"),
    centre_of_mass_=number("centre of mass", "m", "axis"), inertia_=_INERTIA,
)  # fmt: skip
_WIDTH = Either((number("width", "m"), text('width, such as "0.05 mm"')))
_CALLOUT = record(
    feature=text("frame, or joint of the body"), name_=text("name in reports"),
    **{f"{word}_": _WIDTH for word in (*LOCATIONS, *ORIENTATIONS)},
    extent_=Either((_WIDTH, Listed(_WIDTH))), diameter_=_WIDTH,
    hole_=text('size of a hole with (M), such as "12 H7"'),
    direction_=_DIRECTION, length_=text('length, such as "452 +- 0.1 mm"'),
    general_=text('"ISO 2768-mK"'), distribution_=Words((*DISTRIBUTIONS,)),
    cp_=number("process capability index of a normal distribution"),
)  # fmt: skip
_OF_FRAME_FEATURE = record(
    "", _CALLOUT, after_=flag("feature on the child body of the joint"),
    shape_=Words((*SHAPES,)),
    axis_=_DIRECTION, at_=_POINT,
    datums=Listed(Either((
        text("frame"),
        record(frame=text("frame"), shape_=Words((*HELD,)), axis_=_DIRECTION,
               at_=_POINT, hole_=text("size of a hole with (M)"),
               hole_of_=text("fit or joint of the hole"),
               extent_=number("length of the hole as datum A", "m")),
    ))),
    hole_of_=text("fit or joint of the hole"),
)  # fmt: skip
_OF_BODY_FEATURE = record(
    "", _CALLOUT,
    datums=text('joints in the order A, B, C; "B (M)" for maximum material', "joint"),
    datum_hole_=text('size of the datum hole with (M), such as "12 H7"'),
    datum_extent_=_WIDTH,
    flatness_=_WIDTH, cylindricity_=_WIDTH,
)  # fmt: skip
_NUMBERS = Each(number("parameter", ""))
_EFFECT = record(
    name=Words((*LIBRARY, FUNCTION)), parameters_=_NUMBERS, session_=text("session"),
    label_=text("label"), where_=text('a frame, "base", "reading" or "load"'),
    kind_=Words(KINDS), components_=text("components", "component"),
    variables_=text("variables", "variable"), form_=Words((*FORMS, FORMULA)),
    formula_=text("formula"), std_=_NUMBERS,
)  # fmt: skip
_COMMON = record(
    name_=text("name of the robot"), description_=text("description"),
    effect_=Listed(_EFFECT),
    learned_range_=Each(number("minimum and maximum value", "", "bound")),
    reference_point_="reference_point", diagnosis_=Each(Anything()),
    covariance_=text("path of the covariance file"),
)  # fmt: skip
_OF_FRAMES = record(
    "", _COMMON, format_=Words((1,)), platform=text("name of the platform frame"),
    frame=Listed(_FRAME),
    closure_=Listed(record(frames=text("two frames that coincide", "frame"))),
    tolerance_=Listed(_OF_FRAME_FEATURE),
)  # fmt: skip
_GAP = number("gap on each side in the centred position", "m")
_CONTACTS = record(
    "", _CLEARANCE,
    bearings_=Listed(
        record(z=number("position along z", "m"), radial_=_GAP, fit_=_FIT)
    ),
    guide_=record(
        gap_=Either((_GAP, number("gaps along x and y", "m", "axis"))),
        fit_=Either((_FIT, Listed(_FIT))),
        length=number("length along the axis", "m"),
        width=number("width along x", "m"), height=number("height along y", "m"),
    ),
    pad_=record(
        gap_=_GAP, fit_=_FIT, length=number("length along x", "m"),
        width=number("width along y", "m"),
    ),
)  # fmt: skip
# a universal joint can have different values for its two bearings
_OF_JOINT = record(**{
    f"{key}_": Either((one, Listed(one)))
    for key, one in (
        ("clearance", _CONTACTS),
        *((k, _FRAME.content[k]) for k in ("joint_stiffness", "geometric_error",
                                           "tolerance")),
    )
})  # fmt: skip
_PIECE = record(
    end_=_POINT, center_=_POINT,
    turn_=number("rotation vector of an arc", "rad", "axis"),
    up_=_DIRECTION, section_=_BEAM, tip_section_=_BEAM,
)  # fmt: skip
_BODY = record(
    name=text("name"), mass_=number("mass in addition to that of the link", "kg"),
    centre_=_POINT,
    inertia_=_INERTIA,
    link_=record(
        "", _LINK, curve_=Listed(_PIECE), theory_=Words(("timoshenko", "euler"))
    ),
    up_=_DIRECTION, from_=text("joint at which the link begins"),
    to_=text("joint at which the link ends"),
    tolerance_=Listed(_OF_BODY_FEATURE),
)  # fmt: skip
_JOINT = record(
    "", _OF_JOINT, name=text("name"), type=Words((*FREE_ROWS,)),
    between=text("two bodies", "body"), at=_POINT, axis_=_DIRECTION, axis2_=_DIRECTION,
    pitch_=number("translation of a helical joint per turn", "m"),
    actuated_=flag("actuated"),
    position_=number("coordinate in the home pose", "rad or m"),
    limits_=number("minimum and maximum coordinate", "rad or m", "bound"),
    drive_stiffness_=number("stiffness of the drive", "N m/rad or N/m"),
    locked_at_=_LOCKED_AT,
)  # fmt: skip
_LEG = record(
    name=text("name"),
    repeat_=record(count=count("number of copies"), about=_DIRECTION, at_=_POINT),
    body_=Listed(_BODY), joint_=Listed(_JOINT),
)  # fmt: skip
_OF_BODIES = record(
    "", _COMMON, format_=Words((2,)), platform=text("name of the platform body"),
    platform_at_=_POINT, body_=Listed(_BODY), leg_=Listed(_LEG), joint_=Listed(_JOINT),
    tolerance_=Listed(_OF_BODY_FEATURE),
)  # fmt: skip
ROBOT_FILE = Either((_OF_FRAMES, WithUnits(_OF_BODIES)))
