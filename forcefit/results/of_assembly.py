"""Records for the JSON output of ``forcefit assembly ...`` and ``forcefit convert``."""

from collections.abc import Mapping

from forcefit.results.quantities import count, flag, number, text
from forcefit.results.records import (
    Content,
    Each,
    Either,
    Listed,
    Record,
    Words,
    record,
)

_SHARE = number("share")
_AXIS = ("axis",)
# records used in several outputs
POSE = record("rx? ry? rz? tx? ty? tz?")
_POSTURE = record("robot status reason?", pose=POSE)
INTERVAL = record("probability lower upper undecided?")
_ESTIMATE = record("value lower upper")
_MEAN = record("value lower upper", deviation=number("standard deviation", ""))
_QUANTILES = Each(_ESTIMATE)
ZONE = record(
    "status reason? assemblable assemblable_free margin margin_free margin_bound "
    "margin_free_bound"
)
_SOLVED = record(
    "energy potential? platform_screw",
    frames=Each(record("clearance link joint wrench joint_wrench start_wrench?")),
    closures=Listed(record("frames wrench")),
)
_LINEARISATION = record(
    "status? energy? relative_energy?",
    rotation_=number("rotation, linear minus exact", "rad", *_AXIS),
    translation_=number("translation, linear minus exact", "m", *_AXIS),
)
_COUNTS = record(
    "freedoms platform_freedoms freedoms_drives_locked platform_freedoms_drives_locked "
    "redundant_constraints drives locked_freedoms overconstraint "
    "smallest_singular_value local_freedoms actuation_redundancy singular_value_gap"
)
MOBILITY = record(
    "counts_certain singular finite_freedoms words", _COUNTS, near_=_COUNTS,
    motions=Listed(record(
        kind=Words(("translation", "turn", "screw")),
        direction=number("direction of translation or axis, in base axes", "1", *_AXIS),
        point_=number("point on the axis, in base axes", "m", *_AXIS),
        pitch_=number("pitch of a screw", "m"),
    )),
)  # fmt: skip
SOLUTION = record(
    "nominal_mismatch remarks load gravity reading? method?", _POSTURE, _SOLVED,
    joints=Each(number("joint coordinate", "rad or m")),
    joint_frames_=Each(text("frame with the point and the axes of a joint")),
    mobility=MOBILITY,
    zone_=ZONE,
    certificate_=record(
        "closure_residual reference_length clearance_excess duality_gap relative_gap "
        "screw_rotation screw_translation screw_rotation_open screw_translation_open "
        "screw_rotation_error screw_translation_error"
    ),
    ranks_=record("free elastic rigid redundant"),
    linearisation_error_=_LINEARISATION,
    worst_error_=record("assumption rotation translation"),
)  # fmt: skip
_EXACT = record(
    "remarks?", _POSTURE, mobility=MOBILITY,
    energy_="energy", potential_="potential", platform_screw_="platform_screw",
    frames_=_SOLVED.content["frames"], closures_=_SOLVED.content["closures"],
    certificate_=record(
        "closure_residual reference_length clearance_excess stationarity iterations"
    ),
    linear_=record("energy platform_screw"), linearisation_error_=_LINEARISATION,
)  # fmt: skip
_LOWER_UPPER = record(lower=number("lower bound", ""), upper=number("upper bound", ""))
_BOUNDS = record("platform_screw", _LOWER_UPPER)
_ASSUMPTIONS = Each(
    record("cuts? method? reason?", rotation=_BOUNDS, translation=_BOUNDS,
           along_=_BOUNDS)
)  # fmt: skip
_ERROR = record(
    "load? gravity? point? direction? energy? platform_screw? remarks?", _POSTURE,
    error_=_ASSUMPTIONS, certificate_=record("relative_gap"),
    bolted_worst_=record("assumption", rotation=_LOWER_UPPER, translation=_LOWER_UPPER),
)  # fmt: skip
_SHARES = record(
    links=Each(_SHARE), joints=Each(_SHARE), clearances_=Each(_SHARE),
    forces_=number("share of the internal forces and loads"),
)  # fmt: skip
_ALONG = record(
    free=number("stiffness if the other directions are free", "N m/rad, N/m"),
    blocked=number("stiffness if the other directions are blocked", "N m/rad, N/m"),
)
_TANGENT = record(
    "state stiffness free_motions rigid_wrenches "
    "characteristic_length centre",
    point=number("reference point of matrices and screws, in base axes", "m", "axis"),
    compliance=number("compliance of the platform at this point, in base axes",
                      "rad/(N m) .. m/N", "screw", "wrench_component"),
    eigen=Listed(record("screw pitch", stiffness=number("eigenstiffness", "N/m"))),
    condition=number("condition number of the stiffness"), along=Each(_ALONG),
    shares=Each(_SHARES),
)  # fmt: skip
_CONTACT = record(
    "", _TANGENT, side_=text("direction of the load change: loading or unloading"),
    contacts_=count("closed clearances"),
    touching_=count("clearances in contact without a force"),
)  # fmt: skip
_SLOPES = Each(number("derivative of the compliance", "", "row", "column"))
PLATFORM_STIFFNESS = record(
    "load? gravity? remarks?", _POSTURE,
    Record(_TANGENT.content, frozenset(_TANGENT.content)),
    contact_=Listed(_CONTACT), letting_go_=_CONTACT,
    direction_=record("direction", _ALONG, shares=_SHARES),
    slopes_=_SLOPES, slopes_contact_=_SLOPES, cannot_change_=Each(text("reason")),
)  # fmt: skip
_DEFLECTION = record(
    "state?", _POSTURE,
    along=text("component of the load"),
    followed=flag("equilibrium path beyond limit points"),
    loads_=number("load", "N m or N", "point"),
    deflection_=number("deflection", "rad or m", "point"),
    platform_screw_=number("platform error", "rad, m", "point", "screw"),
    energy_=number("energy", "J", "point"),
    stiffness_=number("tangent stiffness", "N m/rad or N/m", "point"),
    contacts_=text("closed clearances", "point", "name"),
    free_in_clearances_=flag("free motion within clearances", "point"),
    events_=Listed(record(load=number("load", "N m or N"), kind=text("kind of event"),
                          what=text("description of the event"),
                          deflection=number("deflection", "rad or m"))),
)  # fmt: skip
_FREQUENCIES = record(
    "state remarks idle_motions?",
    _POSTURE,
    frequencies_=number("natural frequencies", "Hz", "mode"),
    discretisation_errors_=number(
        "estimated relative errors of the frequencies", "", "mode"
    ),
    modes_=Listed(
        record(
            "platform_screw",
            shares=Each(_SHARE),
            frequency=number("natural frequency", "Hz"),
        )
    ),
)
_BY_NAME = Each(number("value", ""))
_CLEARANCE_MODEL = text("clearance model")
_REACHED = record(
    "unit limit?", reached=number("value with perfect parts", ""),
    clearances_=Each(number("contribution of the clearance", "")),
)  # fmt: skip
_OF_DRAWS = record(
    "unit draws assembled", of=count("total number of draws"),
    clearance_=_CLEARANCE_MODEL,
    all_draws_=record(infinite=INTERVAL, quantiles=_QUANTILES), zero_=INTERVAL,
    mean_=_MEAN, quantiles_=_QUANTILES, most_probable_=_ESTIMATE,
)  # fmt: skip
_LIMITED = record("", INTERVAL, clearance_=_CLEARANCE_MODEL)
_STIFFNESS_OF_DRAWS = record(
    "state", means=text("meaning of the state"),
    axes=Each(record(
        "unit draws", free_=INTERVAL, rigid_=INTERVAL, mean_=_MEAN,
        quantiles_=_QUANTILES,
    )),
    free_motions=Listed(record("screw draws")),
)  # fmt: skip
_IMPORTANCE = record(
    base_draws=count("base draws"), clearance=_CLEARANCE_MODEL,
    quantities=Each(
        record("reason?",
               largest_share_left_out=number("largest fraction of omitted base draws"),
               first_index_=Each("first_index"), total_index_=Each("total_index"),
               rank_=Each("rank"))
    ),
    platform=Each(
        record(
            error_unit=text("unit of the error"),
            rotation_part=number("rotation due to the error", "rad"),
            translation_part=number("translation due to the error", "m"),
            rotation_gain=number("rotation for each unit of error", ""),
            translation_gain=number("translation for each unit of error", ""),
        )
    ),
)  # fmt: skip
STATISTICS = record(
    "robot seed load gravity draws assembled confidence contact_length duality_gap",
    pose=POSE, clearance=_CLEARANCE_MODEL,
    clearance_means=text("meaning of the clearance model"),
    assembles=Each(INTERVAL),
    clearance_not_mixed_=count("draws whose clearance walk did not mix"),
    exceeds=Each(record("limit unit", _LIMITED)), within_limits_=_LIMITED,
    perfect_parts=Each(_REACHED), perfect_parts_break=Each(_REACHED),
    quantities=Each(_OF_DRAWS),
    platform_screw_=record(
        "draws", clearance=_CLEARANCE_MODEL, mean=number("mean", "rad, m", "screw"),
        covariance=number("covariance", "rad^2 .. m^2", "screw", "screw"),
        most_probable=Listed(_ESTIMATE),
    ),
    safety_=number("safety", "1", "link"),
    stress_error_=number("estimated relative error of the stress", "1", "link"),
    stiffness_=_STIFFNESS_OF_DRAWS, importance_=_IMPORTANCE,
    capability_=Each(
        record("limit unit", cp=_ESTIMATE, cpk=_ESTIMATE, ppm=_ESTIMATE)
    ),
    worst_case_=Each(
        record(
            "unit", reading=text("type of worst case"),
            means=text("meaning of the type"),
            attained=number("value attained", ""), bound=number("certified bound", ""),
            direction=number("direction of the value attained", "1", "axis"),
            shares=Each(number("contribution of an error or a clearance", "")),
            rigid_=number("value attained without forces", ""),
        )
    ),
)  # fmt: skip
_CLASS = record(
    "name tolerance unit", share=_SHARE,
    scaled_alike=number("tolerance for a common factor on all tolerances", ""),
    cost=number("cost"), loosest_allowed=number("largest allowed tolerance", ""),
    at_loosest=flag("tolerance equal to the largest allowed one"),
    width_=flag("tolerance is the full width of a zone"),
)  # fmt: skip
_VERIFICATION = record(
    "draws verdict confidence", look=count("interim test"),
    most_looks=count("largest number of interim tests"),
    worst_posture_yield=number("yield at the worst posture"),
    posture_yields=number("yield at each posture", "1", "posture"),
    largest_share_of_a_limit=number("largest share of a limit"),
    confidence_of_a_look=number("confidence of each interim test"),
    **{"yield": INTERVAL},
)  # fmt: skip
_ALLOCATION = record(
    "yield price cuts draws seed contact_length", limits=_BY_NAME,
    cost=text("law of the cost"), tolerances=Listed(_CLASS),
    price_alike=number("price for a common factor on all tolerances"),
    price_bound=number("lower bound of the price"),
    worst=Each(record(found=number("largest found", ""), proven=number("proven", ""))),
    proven_scale=number("factor on all tolerances for which the limits are proven"),
    verification=_VERIFICATION,
    clearance=_CLEARANCE_MODEL, distribution=text("distribution within a tolerance"),
    deviations=number("standard deviations in a tolerance"),
    perfect_parts=Each(
        record("unit limit", reached=number("value with perfect parts", ""),
               at=text("posture"),
               looser_without=number("looser tolerances without clearances"),
               price_without=number("price without clearances"))
    ),
)  # fmt: skip
_PRESENT = record(
    "postures", quantity=text("zone margin that is computed"),
    largest_margin=number("largest margin"),
    margins=number("margins", "1", "posture"), at=POSE,
    factor_on_errors=number("factor on all errors at which all postures assemble"),
    energy_there=number("energy at the largest margin", "J"),
    assemblable_share=number("share of postures that assemble"),
    slopes=Listed(
        record("value", error=text("error"),
               margin_slope=number("derivative of the margin", ""),
               share_of_margin=number("share of the margin"),
               energy_slope=number("derivative of the energy", ""))
    ),
)  # fmt: skip
_TOLERANCES = record(
    "robot postures grid", left_out=Each(count("postures")), present_=_PRESENT,
    allocation_=_ALLOCATION,
)  # fmt: skip
_SWEEP = Record(
    record(
        "robot", output=text("file"), axes=Each(count("points")),
        points=count("points"), status=Each(count("points")),
        quantities=Each(
            record(units=text("unit"), min=number("smallest", ""),
                   median=number("median", ""), max=number("largest", ""))
        ),
    ).content,
    closed=False,
)  # fmt: skip
_BY_QUANTILE = Each(number("quantile", ""))
_STEP = record(
    "platform_screw",
    name=text("name of the step"), kind=text("kind of the step"),
    energy=number("energy of all springs, including fixtures", "J"),
    work=number("work of the step", "J"),
    load_work=number("work of the loads that act before and after", "J"),
    lost=number("energy lost by a release", "J"),
    closing_force=number("largest closing force", "N"),
    closing_moment=number("largest closing moment", "N m"),
    closing_wrench=number("closing wrench, in axes of the closure or fixture", "N m, N",
                          "wrench_component"),
    opening=number("opening that free motions cannot close", "rad, m",
                   "screw"),
    left_open_=number("opening that remains after the step", "rad, m", "screw"),
    spring_back_=number("motion of what is released, in its axes", "rad, m", "screw"),
    reading_=number("reading", "rad or m", "component"),
    exceeded_=flag("requires more than the allowed force"),
    adjustment_=number("change of the geometric error", "rad or m", "component"),
    wrenches=Each(
        number("wrench locked in after the step", "N m, N", "wrench_component")
    ),
)  # fmt: skip
_STEPS = record(
    "remarks platform_screw?", _POSTURE, steps=Listed(_STEP),
    order_=record(
        objective=Words(("force", "energy", "error")), value=number("value", ""),
        bound=number("lower bound in any order", ""),
        given=number("value in the given order", ""), searched=count("computed states"),
        steps=text("names of the steps", "step"),
    ),
    influences_=Listed(record(
        locked=text("step that holds the opening that it finds", "step"),
        joined=text("step that may move this opening", "step"),
        zero=flag("closing the part does not move the opening, for any errors"),
        free=flag("a free motion moves both openings"),
        coefficients=Listed(number(
            "motion of a locked component by the closing wrench",
            "rad or m per N m or N",
        )),
    )),
    first_energy_=number("energy before the first step", "J"),
    energy_=number("energy of the assembled machine", "J"),
    work_=number("work of all steps", "J"), lost_=number("energy lost", "J"),
    peak_force_=number("largest closing force", "N"),
    draws_=count("machines"), quantiles_=Each(Each(_BY_QUANTILE)),
)  # fmt: skip
_PEAK = record(
    "time unit?", value=number("largest value", ""), frame_=text("frame of the body")
)  # fmt: skip
_PATH = record(
    "robot status reason? remarks first_frequency periods", output_=text("file"),
    law=text("law of the motion"), duration=number("path time", "s"),
    points=count("points"), solved=count("points with a result"),
    largest_=Each(_PEAK), drives_=Each(_PEAK),
)  # fmt: skip
ASSEMBLY: Mapping[str, Content] = {
    "assembly solve": Either((SOLUTION, _EXACT, record("robot", zone=ZONE))),
    "assembly show": record(
        "robot remarks", pose=POSE, mobility=MOBILITY,
        axes=Each(record(
            at=number("origin of the frame, in base axes", "m", *_AXIS),
            x=number("x axis of the frame, in base axes", "1", *_AXIS),
            z=number("z axis of the frame, in base axes", "1", *_AXIS),
        )),
    ),
    "assembly error": _ERROR,
    "assembly stiffness": PLATFORM_STIFFNESS,
    "assembly deflection": _DEFLECTION,
    "assembly frequencies": _FREQUENCIES,
    "assembly statistics": STATISTICS,
    "assembly tolerances": _TOLERANCES,
    "assembly sweep": _SWEEP,
    "assembly steps": _STEPS,
    "assembly path": _PATH,
    "convert": record(
        "robot left_out", platform=text("platform"), frames=count("frames"),
        closures=count("closures"), files=text("files written", "file"),
        home=record(
            open_before=number("closure gap at the home pose of the file", "rad or m"),
            open_after=number("closure gap at the computed home pose", "rad or m"),
            drives_held=flag("drives kept at their home coordinates"),
        ),
        largest_difference=number("largest difference when read back"),
        compared=Listed(
            record(
                where=text("location of the largest difference"),
                reader=text("program"), file=text("file"),
                why_not=text("reason why no comparison was made"),
                bodies=count("bodies"),
                masses=count("masses"), loops=count("loops"),
                difference=number("largest difference"),
            )
        ),
        taken=text("assumptions", "line"),
    ),
}  # fmt: skip
