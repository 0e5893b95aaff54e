"""Records for the JSON output of commands that process measured data."""

from collections.abc import Mapping

from forcefit.results.quantities import count, flag, number, text
from forcefit.results.records import Content, Each, Either, Listed, Record, record

_ERROR_UNIT = record(position=text("unit"), rotation=text("unit"))
_ERRORS = record("position rotation normalised")
_SIZES = record("position rotation")
_BEYOND = record(
    "rows", variable=text("variable"), learned=number("range learned", "", "bound"),
    now=number("range in these rows", "", "bound"),
)  # fmt: skip
_PARAMETER = record(
    "name value std unit", interval_90=number("90 % interval", "", "bound"),
    found_=record(declared=number("declared", ""), difference=number("found", ""),
                  corrected=number("corrected", "")),
)  # fmt: skip
_EFFECT = record(
    "name where probability", session_=text("session"),
    combinations_=number("combinations that the readings determine"),
    parameters=Listed(_PARAMETER),
)  # fmt: skip
_RANDOM_EFFECTS = record(
    "unknowns where", scale=Each(number("prior standard deviation", "")),
    unit=Each(text("unit")), identifiable=number("combinations determined"),
    frames=Listed(record(frame=text("frame"),
                         identifiable=number("combinations determined"))),
    parameters=Listed(
        record("value std unit", frame=text("frame"), component=text("component"),
               identified=number("share determined by the readings"))
    ),
)  # fmt: skip
_LEARNED = record(
    label=text("label"), where=text("place"),
    components=text("components", "component"),
    variables=text("variables", "variable"), kind=text("kind"), form=text("form"),
    formula=text("formula"), parameters=Each(number("parameter", "")),
    std=Each(number("standard deviation", "")),
    equivalent_places=Listed(Listed(
        record(where=text("place"), components=text("components", "component"),
               variables=text("variables", "variable"))
    )),
    before=_ERRORS, after=_ERRORS, parts_of_range=record(
        "after", variable=text("variable"),
        without=number("normalised error without the function"),
    ),
)  # fmt: skip
_DIAGNOSIS = record(
    "campaign robot verdict remarks not_measured",
    needed=text("measurement that would distinguish the effects"),
    sentence=text("conclusion in a sentence"),
    effects=Listed(_EFFECT), alternatives=Listed(record("names probability")),
    probabilities=Each("probability"),
    best_by_score=text("effects of the model with the best score", "effect"),
    error=record(
        unit=_ERROR_UNIT, before=_ERRORS, after=_ERRORS, saved=_ERRORS, noise=_SIZES,
        with_outliers=record(before=_ERRORS, after=_ERRORS),
    ),
    noise_scale=record(
        "value std normalised", findings=text("findings", "line"),
        common=record("rotation translation"),
    ),
    noise_in_time=record(
        "probability", share=number("share of the variance"),
        constant=number("time constant", "s"),
    ),
    ladder=Listed(
        record(
            "unit", term=text("model of the sequence"),
            unknowns=number("unknowns"), kept_aside_rms=number("held-out rms", ""),
            kept_aside_rotation=number("held-out rotation rms", "rad"),
            kept_aside_sigma=number("held-out normalised error"),
        )
    ),
    geometry=_RANDOM_EFFECTS, springs=_RANDOM_EFFECTS, learned=Listed(_LEARNED),
    held_out=record(
        "rows", how=text("split or folds"), words=text("description of the split"),
        ids=text("ids", "row"), uncertainty=number("uncertainty of the error"),
    ),
    lack_of_fit=record(
        "rms probability", between_repeats=number("probability between repeats")
    ),
    setup_blunders=Listed(
        record("before after", kind=text("kind"), columns=text("columns", "column"),
               sentence=text("check of the set-up"))
    ), outliers=text("outliers", "row"),
    open=text("rows whose pose is undetermined", "row"),
    structure=Listed(
        record("probability", against=text("variable"),
               share=number("share of the squared residual"))
    ),
    next_measurement=Record({
        "why": text("reason"), "configuration": Each(number("coordinate", "rad or m")),
        "load": number("load at the reference point, base axes", "N m, N",
                       "wrench_component"),
        "covariates": Each(number("covariate", "")),
        "power": number("non-centrality of one such reading"),
    }),
    calibration=Record({
        "campaigns": count("simulated campaigns of each kind"),
        "without": Each(count("campaigns")), "with_found": Each(count("campaigns")),
        "right": number("fraction with correctly identified effects"),
        "false_claims": number("share of false claims"),
    }),
)  # fmt: skip
_REVISITS = record(
    "rows", sets=count("sets of repeats"), others=count("rows without a repeat"),
    adjacent=number("share of repeats in direct succession"),
    span=number("fraction of the session from first to last repeat"),
    order=text("order"),
)  # fmt: skip
_COMPONENT = Each(number("noise", "rad or m"))
_NOISE = record(
    ratio=number("noise from repeats divided by the declared sigma"),
    degrees=number("degrees of freedom"), interval=number("interval", "1", "bound"),
    ratio_with_slow_changes=number("ratio including slow changes"),
    chance_without_change=Each("probability"), component=_COMPONENT,
    component_degrees=Each(number("degrees of freedom")),
    component_interval=Each(number("interval", "rad or m", "bound")),
    suspects=Listed(record(rows=text("rows", "row"), component=text("component"),
                           size=number("size in standard deviations"),
                           chance=number("probability due to noise"))),
)  # fmt: skip
_BOUNDS = number("smallest and largest value", "", "bound")
_LOADS = record(
    levels=count("different loads"), unloaded_rows=count("rows without load"),
    force=number("least and largest force", "N", "bound"),
    moment=number("least and largest moment", "N m", "bound"),
    components=text("components", "component"),
    configurations_under_several=count("configurations under several loads"),
)  # fmt: skip
_COVARIATE = record(
    "std", range=_BOUNDS, levels=count("different values"),
    correlation=Each(number("correlation")),
)  # fmt: skip
_READINGS_OF = record(
    measured=count("rows measured"), missing=count("rows missing"),
    rms_=number("root mean square", "rad or m"),
    largest_=number("largest", "rad or m"), sigma_=number("sigma", "rad or m", "bound"),
)  # fmt: skip
_TESTED = record(
    testable=flag("testable"), why_=text("reason if not testable"),
    shows_=flag("detectable"),
    shows_at_=number("multiple of the plausible size at which it is detectable"),
    strength_=number("non-centrality"),
    left_by_registration_=number("share not removed by the registration"),
    unknowns_=count("unknowns"), rank_=count("rank"),
)  # fmt: skip
_PAIRS = text("effects", "pair", "effect")
_INSPECTION = record(
    "campaign robot rows registration reference_point",
    commanded=text("commanded quantities"), configurations=record(
        "", _REVISITS, count=count("configurations"),
        rows_each=number("least, median and most rows of each", "1", "statistic"),
    ), loads=_LOADS,
    readings=Each(_READINGS_OF), covariates=Each(_COVARIATE), repeats=_REVISITS,
    noise=_NOISE,
    effects=Each(_TESTED), inseparable=_PAIRS, imitated=_PAIRS, overlapping=_PAIRS,
    cosines=record(
        effects=text("effects", "effect"),
        smallest_angle=number("cosine of the smallest angle", "1", "effect", "effect"),
        shared=number("shared part", "1", "effect", "effect"),
    ),
    remarks=Listed(record(about=text("about"), weight=text("weight"),
                          text=text("remark"))),
    open=text("rows whose pose is undetermined", "row"),
)  # fmt: skip
_UNANSWERED = Listed(record("reason", id=text("row")))
_POSE_FIGURES = record(
    "accuracy repeatability", label=text("row"), cycles=count("cycles"),
    angles=number("angle accuracy", "rad", "axis"),
    angle_repeatability=number("angle repeatability", "rad", "axis"),
    drift=number("drift", "m"),
)  # fmt: skip
_AXIS = record(
    **{
        name: number(f"{words}, {letter}", "rad or m")
        for name, words, letter in (
            ("reversal", "largest reversal", "B"),
            ("mean_reversal", "mean reversal", "B mean"),
            ("repeatability_forward", "repeatability forward", "R up"),
            ("repeatability_backward", "repeatability backward", "R down"),
            ("repeatability", "repeatability of both directions", "R"),
            ("systematic_deviation", "systematic deviation", "E"),
            ("mean_deviation", "mean deviation", "M"), ("accuracy", "accuracy", "A"),
        )
    }
)  # fmt: skip
_ISO = record(
    "campaign registration",
    iso_9283=record(
        poses=Listed(_POSE_FIGURES),
        distances=Listed(
            record("accuracy repeatability", labels=text("rows", "row"),
                   commanded=number("commanded distance", "m"))
        ),
    ),
    iso_230_2=Each(_AXIS),
)  # fmt: skip
_SESSION = record(
    session=text("session"), setup_rows=count("set-up rows"),
    other_rows=count("remaining rows"), suffices=flag("set-up rows suffice"),
    open=text("undetermined parameters", "name"),
    uncertainty=number("uncertainty after the set-up rows", "m"),
    left_in_setup=number("residual of the set-up rows", "m"),
    held_in_setup=number("error of the saved robot at the set-up rows", "m"),
    left_behind=text("effects of other sessions", "effect"), error=_ERRORS,
    declared=_ERRORS,
    parameters=Listed(record("name value std", effect=text("effect"))),
)  # fmt: skip
_CURVE = record(
    label=text("label"), where=text("place"), component=text("component"),
    kind=text("kind"), form=text("form"), formula=text("formula"),
    session=text("session"), parameters=Listed(record("name value std unit")),
    variable=text("variable"), beside=Each(number("constant variable", "")),
    units=record(variable=text("unit"), value=text("unit")),
    x=number("variable", "", "point"), value=number("value", "", "point"),
    std=number("standard deviation", "", "point"),
)  # fmt: skip
MEASUREMENT: Mapping[str, Content] = {
    "validation diagnose": _DIAGNOSIS,
    "validation generate": record("rows", folder=text("folder")),
    "validation inspect": Either((_INSPECTION, _ISO)),
    "validation plan": record(
        "rows", configurations=count("configurations"),
        pairs=Listed(
            record(effect=text("effect"), fitted=text("effect fitted"),
                   planned=number("non-centrality as planned"),
                   random=number("non-centrality of random rows"))
        ),
    ),
    "validation import": record(
        "robot rows scatter left_out remarks", joined_by=text("method of matching"),
        readings=count("readings"),
        device=record(rotation=number("rotation", "1", "row", "column"),
                      shift=number("position", "m", "axis")),
        mounts=Each(number("axes on the platform", "rad", "axis")),
    ),
    "validation carry": record(
        machine=record(numbers=count("fitted parameters of the robot"),
                       widened=number("factor on their covariance")),
        sessions=Listed(_SESSION),
        unit=record(position=text("unit"), rotation=text("unit"),
                    uncertainty=text("unit")),
        beyond_learned_range=Listed(_BEYOND),
    ),
    "validation explain": record(functions=Listed(_CURVE)),
    "validation predict": record(
        "rows registration reference_point not_measured",
        without_answer=_UNANSWERED, open=count("rows whose pose is undetermined"),
        identified_at=number("point at which the robot was identified", "m", "axis"),
        extrapolated=Listed(record(id=text("row"), variables=text("variables"))),
        std=_SIZES, noise=_SIZES, error=record("", _ERRORS, unit=_ERROR_UNIT),
        beyond_learned_range=Listed(_BEYOND),
    ),
    "validation compensate": record(
        "rows not_measured", drives=text("drives", "drive"),
        offsets=number("offsets of the drives", "rad or m", "row", "drive"),
        error=record(unit=_ERROR_UNIT, before=_SIZES, after=_SIZES, spread=_SIZES,
                     expected=_SIZES),
        limited=text("rows at a limit", "row"), without_answer=_UNANSWERED,
        beyond_learned_range=Listed(_BEYOND),
    ),
}  # fmt: skip
