"""Records for the JSON output of cross-checks, studies, checks and comparisons."""

from collections.abc import Mapping

from forcefit.results.of_assembly import POSE, SOLUTION, STATISTICS
from forcefit.results.quantities import count, flag, number, text
from forcefit.results.records import Content, Each, Either, Listed, Record, record

_ASKED = Each(number("pose component or joint coordinate", "rad or m"))
_SIDE = record(
    "platform_screw energy", links=Each("wrench"), joints=Each("wrench"),
    energy_between_ends_=number("energy of weights between link ends", "J"),
    closure_gap_=number("largest closure error"),
    free_motions_held_=flag("free motions blocked"), seconds_="seconds",
)  # fmt: skip
_SCALE = record("scale", vjm=_SIDE, exact_vjm=_SIDE, multibody=_SIDE, difference=_SIDE)
_CHECK = record("value tolerance verdict passed", uncertainty=number("uncertainty", ""))
_POSE_CHECK = record(
    "robot status load gravity slope verdict passed reason?", pose=POSE,
    links=text("model of the links"), scales=Listed(_SCALE),
    added_scales=Listed(_SCALE), clearances=text("clearances"),
    slopes_=Each(number("slope")), limits_=Each(number("limit")),
    unexplained_=Each(number("unexplained share")),
    optimality_gaps_=number("optimality gap", "1", "scale"),
    relative_energy_differences_=Each(number("difference", "1", "scale")),
    checks=Each(_CHECK),
    smallest_changes_noticed=Listed(
        record("name value", kind=text("kind"), relative=number("relative change"),
               check=text("check that detects the error"), unproved=flag("not proven"))
    ),
)  # fmt: skip
_BY_METHOD = Each(number("value"))
CROSSCHECK = Either((
    _POSE_CHECK,
    record(
        "robot? status reason passed load? gravity? slope? verdict?", pose_=POSE,
        links_=text("model of the links"), scales_=Listed(_SCALE),
    ),
    record(
        "robot load tolerance passed", pose=POSE, links=text("model of the links"),
        compliance=Each("compliance"), difference=_BY_METHOD, uncertainty=_BY_METHOD,
        undecided_joints=text("joints not decided", "joint"),
        moved=Each(number("displacement", "rad, m", "screw")),
        stable=Each(flag("stable")),
        another_equilibrium=flag("different equilibrium"),
    ),
    record(
        "passed", reached=count("poses reached"),
        poses=Listed(Record(
            {**_POSE_CHECK.content, "asked": _ASKED},
            frozenset(_POSE_CHECK.content), closed=False,
        )),
    ),
))  # fmt: skip
_COST = record(
    "reason?", rotation_="rotation", position_="position",
    energy_=number("relative energy"), matters_=flag("above a limit"),
    pieces_=count("pieces of each beam with errors below the limits"),
)  # fmt: skip
_LIMITS = record("position", energy=number("relative energy"))
_SPREAD = record(median=number("median", ""), largest=number("largest", ""), at=_ASKED)
_PART = Either((number("relative difference"), _SPREAD))
_PLATFORM_COST = record(
    "reason?", compliance_=Each(_PART), by_link_=Each(_PART),
    without_shape_=text("links without a shape", "link"),
    mesh_error_=number("estimated error of the meshes"),
)  # fmt: skip
_VALIDITY = Either((
    record("robot", pose=POSE, limits=_LIMITS, costs=Each(_COST),
           platform=_PLATFORM_COST),
    record(
        "robot", reached=count("poses reached"), limits=_LIMITS,
        costs=Each(
            record(known=count("poses"), matters=count("poses above a limit"),
                   position=_SPREAD, rotation=_SPREAD, energy=_SPREAD,
                   reasons=Each(count("poses")))
        ),
        platform=_PLATFORM_COST,
        poses=Listed(record("status reason?", asked=_ASKED, costs_=Each(_COST),
                            platform_=_PLATFORM_COST)),
    ),
))  # fmt: skip
_ANY = Either((number("number", ""), text("text"), flag("truth value")))
_CHANGE = record(
    place=text("key", "level"), before=_ANY, after=_ANY,
    relative=number("relative change"),
)  # fmt: skip
VALIDATION: Mapping[str, Content] = {
    "validation crosscheck": CROSSCHECK,
    "validation validity": _VALIDITY,
    "check": record(
        "passed",
        files=Listed(
            record(file=text("file"), kind=text("kind of file"),
                   messages=text("messages", "message")),
        ),
    ),
    "report compare": record(
        compared=text("files", "file"), same=count("equal values"),
        changes=Listed(_CHANGE), only_in_one=Listed(_CHANGE),
    ),
    "study": Record(
        record("passed", program=text("program"), title=text("title"),
               errors=text("errors"), links=text("stiffness of the links"),
               verdicts=Each(text("verdict")), unchecked=Each(text("reason")),
               solution=SOLUTION,
               statistics_=record("", STATISTICS, worst_case_left_out_=text("reason"))
               ).content,
        closed=False,
    ),
}  # fmt: skip
