"""Names of results in words, with the SI unit of their numbers."""

# key of the public format: words, SI unit
WORDS: dict[str, tuple[str, str]] = {
    "freedoms": ("degrees of freedom", ""),
    "platform_freedoms": ("degrees of freedom of the platform", ""),
    "freedoms_drives_locked": ("degrees of freedom, drives locked", ""),
    "platform_freedoms_drives_locked": (
        "degrees of freedom of the platform, drives locked",
        "",
    ),
    "redundant_constraints": ("constraints that others imply, drives locked", ""),
    "drives": ("drives", ""),
    "locked_freedoms": ("degrees of freedom left when the drives are locked", ""),
    "overconstraint": ("closure equations that others already imply", ""),
    "smallest_singular_value": ("smallest singular value of the constraints", ""),
    "margin": ("zone margin, compliant joints rigid", ""),
    "margin_free": ("zone margin, compliant joints free", ""),
    "energy": ("assembly energy", "J"),
    "potential": ("assembly energy less the work of loads", "J"),
    "rotation": ("turn", "rad"),
    "translation": ("shift", "m"),
    "rotation_error": ("largest turn of the platform", "rad"),
    "translation_error": ("largest shift of the platform", "m"),
    "rotation_error_clearance": ("largest turn by clearances alone", "rad"),
    "translation_error_clearance": ("largest shift by clearances alone", "m"),
    "closure_residual": ("closures still open, relative", ""),
    "clearance_excess": ("clearances exceeded, relative", ""),
    "duality_gap": ("energy is at most this above the least", "J"),
    "relative_gap": ("the same, relative", ""),
    "reference_length": ("length that relates shifts to turns", "m"),
    "screw_rotation": ("platform turn known to", "rad"),
    "screw_translation": ("platform shift known to", "m"),
    "screw_rotation_open": ("turn that no energy decides", "rad"),
    "screw_translation_open": ("shift that no energy decides", "m"),
    "screw_rotation_error": ("turn known to, that part aside", "rad"),
    "screw_translation_error": ("shift known to, that part aside", "m"),
    "force": ("largest force in a body", "N"),
    "moment": ("largest moment in a body", "N m"),
    "stress": ("largest stress in a link", "Pa"),
    "position": ("position error", "m"),
    "normalised": ("error over stated noise", ""),
    "before": ("before", ""),
    "after": ("after", ""),
    "yield": ("yield", ""),
    "price": ("price of the tolerances", ""),
    "tolerance": ("tolerance", ""),
    "probability": ("probability", ""),
    "worst_clearance": ("certified worst case", ""),
    "platform_screw": ("platform error", ""),
    "crosscheck": ("cross-check", ""),
    "out of reach": ("out of reach", ""),
}


def in_words(key: str) -> str:
    """A key of the results in words; itself, spaced, where it has none of its own."""
    return WORDS[key][0] if key in WORDS else key.replace("_", " ")


def unit_of(key: str) -> str:
    """SI unit of a key's numbers; empty for pure numbers and unknown keys."""
    return WORDS[key][1] if key in WORDS else ""
