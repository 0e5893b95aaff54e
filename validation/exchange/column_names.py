"""Determine the meaning of a device table's columns from their names."""

import re
from dataclasses import dataclass

QUATERNION = ("w", "x", "y", "z")
_NAMES = {"name", "point", "pointid", "pointname", "target", "id", "label", "group",
          "groupname", "collection", "collectionname", "targetname", "punkt",
          "punktname", "punktid", "punktnummer", "bezeichnung", "ziel"}  # fmt: skip
_TIMES = {"timestamp", "time", "date", "datetime", "datum", "uhrzeit", "zeit",
          "zeitstempel"}  # fmt: skip
_BEFORE = "(?:measurement|measured|meas|actual|point|position|pos|coord|trans|t|p)*"
_AFTER = "(?:measurement|measured|meas|actual|position|pos|coord|coordinate)?"
_AXIS = re.compile(_BEFORE + "([xyz])" + _AFTER)
_SPREAD = re.compile(r"(?:measurement)?(u95|u|uncertainty|sigma|std|stddev|sd)([xyz])")
_QUATERNION = re.compile("(?:quaternion|quat|q|rotation|rot|orientation|ori|o)([wxyz])")
_NUMBERED = re.compile("(?:quaternion|quat|q)([0-3])")
_ANGLE = re.compile("(?:euler|rotation|rot|orientation|ori|angle|r)([xyz])")
_NAMED_ANGLES = {
    "roll": "x", "pitch": "y", "yaw": "z", "omega": "x", "phi": "y", "kappa": "z",
    "c": "x", "b": "y", "a": "z",  # names of the angles on KUKA robots
}  # fmt: skip
# a unit in brackets; does not match the 95 in U(95)
_UNIT = re.compile(r"\[\s*([^\]]*?)\s*\]|\(\s*([^)\d][^)]*?)\s*\)")
_UNIT_AFTER = re.compile(r"\s*[_ /]\s*(mm|um|cm|in|m|deg|mrad|rad)$", re.IGNORECASE)
LENGTH_UNITS = ("mm", "m", "um", "cm", "in")
_WORDS = {"meter": "m", "millimeter": "mm", "centimeter": "cm", "micrometer": "um",
          "inche": "in", "inch": "in", "µm": "um", "μm": "um", "degree": "deg",
          "°": "deg", "radian": "rad"}  # fmt: skip


@dataclass(frozen=True)
class Column:
    """Meaning of a column.

    Attributes:
        kind: ``"axis"``, ``"sigma"``, ``"U"``, ``"quaternion"``, ``"angle"``,
            ``"name"``, ``"time"``, or ``""`` for an ignored column.
        axis: ``x``, ``y`` or ``z``, or ``w`` for the scalar part of a quaternion.
        unit: unit in the name of the column; empty if there is none.
        target: name of the target; empty if the column names none.
    """

    kind: str
    axis: str = ""
    unit: str = ""
    target: str = ""


def column_of(cell: str) -> Column:
    """Return the meaning of a column, determined from its name.

    Args:
        cell: cell of the header.

    Returns:
        The meaning of the column, without its target.
    """
    stated = _UNIT.search(cell)
    unit = (stated[1] or stated[2] or "") if stated else ""
    name = _UNIT.sub("", cell).strip()
    if not unit and (after := _UNIT_AFTER.search(name)):
        unit, name = after[1].lower(), name[: after.start()]
    plain = re.sub(r"[^a-z0-9]", "", name.lower())
    unit = unit_word(unit) or unit
    if plain in _TIMES:
        return Column("time", plain, unit)
    if plain in _NAMES:
        return Column("name", unit=unit)
    if match := _AXIS.fullmatch(plain):
        return Column("axis", match[1], unit)
    if match := _SPREAD.fullmatch(plain):
        return Column("U" if match[1][0] == "u" else "sigma", match[2], unit)
    if match := _NUMBERED.fullmatch(plain):
        return Column("quaternion", QUATERNION[int(match[1])], unit)
    if plain in _NAMED_ANGLES:
        return Column("angle", _NAMED_ANGLES[plain], unit)
    if match := _ANGLE.fullmatch(plain):
        return Column("angle", match[1], unit)
    if match := _QUATERNION.fullmatch(plain):
        return Column("quaternion", match[1], unit)
    return Column("", unit=unit)


def unit_word(text: str) -> str:
    """Return the short name of a unit.

    Args:
        text: a name such as Millimeters, inch, ° or mm.

    Returns:
        The short name; empty if the text is not a unit of length or angle.
    """
    word = text.strip().strip("[]()").lower().replace("metre", "meter")
    if len(word) > 2:
        word = word.removesuffix("s")
    word = _WORDS.get(word, word)
    return word if word in {*LENGTH_UNITS, "deg", "rad", "mrad"} else ""
