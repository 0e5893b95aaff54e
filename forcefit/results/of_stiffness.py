"""Records for the JSON output of ``forcefit stiffness ...``."""

from collections.abc import Mapping

from forcefit.results.quantities import count, flag, number, text
from forcefit.results.records import Content, Each, Either, Listed, Record, record

_MESH = record(
    "nodes? elements? volume? area? unknowns? meshes? seconds?",
    closed_=flag("closed"), worst_quality_=number("quality of the worst element"),
    mean_quality_=number("mean quality"), flat_elements_=count("nearly flat elements"),
    drawn_out_=flag("long elements of an extruded section"),
    smallest_angle_=number("smallest angle between faces", "rad"),
    largest_angle_=number("largest angle between faces", "rad"),
    solver_=text("solver"), accuracy_=number("requested accuracy"),
    reached_=flag("requested accuracy reached"),
    estimate_over_indicator_=number("error estimate over refinement indicator"),
    surface_volume_=number("volume of the surface", "m^3"),
    surface_area_=number("area of the surface", "m^2"),
    repairs_=text("repairs", "line"), parts_=Each(number("volume", "m^3")),
)  # fmt: skip
LINK = record(
    "method tip base relative_error_estimate relative_errors "
    "mass? center_of_mass? inertia?",
    screw=text("components of a screw", "screw"),
    wrench=text("components of a wrench", "wrench_component"), mesh=_MESH,
    stiffness=number("K_E at the tip, axes of its mesh or beam", "N m/rad .. N/m",
                     "wrench_component", "screw"),
    compliance=number("inverse of K_E", "rad/(N m) .. m/N", "screw",
                      "wrench_component"),
)  # fmt: skip
_MATRICES = number("stiffness", "N m/rad .. N/m", "length", "row", "column")
_OVER_LENGTHS = number("difference", "1", "length", "row", "column")
_END_EFFECT = number("end effect, times r / L", "1", "row", "column")
_STRESS = record("von_mises", place=number("place", "m", "axis"))
# Later versions may add keys to an entry, which older versions must not remove.
_ENTRY = Record(
    record(
        "stiffness_error", LINK, format=text("format"), key=text("key"),
        parameters=Each(number("parameter", "")),
    ).content,
    frozenset(("mass", "center_of_mass", "inertia")), closed=False,
)  # fmt: skip
_SOLIDS = record(
    solids=Listed(
        record("name volume", low=number("smallest coordinates", "m", "axis"),
               high=number("largest coordinates", "m", "axis"))
    )
)  # fmt: skip
_COMPARISON = record(
    "difference length slenderness", beam=LINK, fea=LINK,
    end_effect=number("end effect, times r / L", "1", "component"),
    axes_turned=number("rotation of the beam axes with a better fit", "rad"),
    explanation=text("explanation"),
)  # fmt: skip
_OVER_SLENDERNESS = record(
    size=number("size r of the section", "m"),
    slenderness=number("L / r", "1", "length"), beam=_MATRICES, fea=_MATRICES,
    difference=_OVER_LENGTHS,
    relative_error_estimate=number("estimated error of the mesh", "1", "length"),
    end_effect=_END_EFFECT, end_effect_error=_END_EFFECT,
    second=number("second-order coefficient", "1", "row", "column"),
    residual=_OVER_LENGTHS, explanation=text("explanation"),
)  # fmt: skip
_LOOKED_UP = record(
    "stiffness relative_error_estimate", parameters=Each(number("parameter", ""))
)
STIFFNESS: Mapping[str, Content] = {
    "stiffness beam": LINK,
    "stiffness fea": Either((LINK, _SOLIDS)),
    "stiffness convert": LINK,
    "stiffness compare": Either((_COMPARISON, _OVER_SLENDERNESS)),
    "stiffness stress": record(
        "", _STRESS, wrench=number("wrench at the tip", "N m, N", "wrench_component"),
        error=number("estimated error", "Pa"),
        region=text("region"), away=number("distance from the interfaces", "m"),
        beam_=record(
            "", _STRESS,
            von_mises_whole_length=number("largest stress along the length", "Pa"),
        ),
    ),
    "stiffness library": Either((
        record(library=text("folder"), keys=text("keys of the entries", "entry")),
        record(entries=Listed(_ENTRY)),
        _LOOKED_UP,
    )),
}  # fmt: skip
