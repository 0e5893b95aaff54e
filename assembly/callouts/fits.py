"""ISO 286 fits: limits of a hole and a shaft, and the clearance between them.

The tables contain the values of ISO 286-1:2010 for the letters d to p, without the
intermediate size ranges of the standard. A size range includes its upper limit.
"""

import re
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from forcefit.inputs.table import BadInput, quoted

# [mm] upper limits of the ranges of nominal sizes
STEPS = (3, 6, 10, 18, 30, 50, 80, 120, 180, 250, 315, 400, 500)
GRADES = (5, 6, 7, 8, 9, 10, 11)
# [um] tolerance for each range of nominal sizes (rows) and each grade (columns)
_WIDTHS = (
    (4, 6, 10, 14, 25, 40, 60),
    (5, 8, 12, 18, 30, 48, 75),
    (6, 9, 15, 22, 36, 58, 90),
    (8, 11, 18, 27, 43, 70, 110),
    (9, 13, 21, 33, 52, 84, 130),
    (11, 16, 25, 39, 62, 100, 160),
    (13, 19, 30, 46, 74, 120, 190),
    (15, 22, 35, 54, 87, 140, 220),
    (18, 25, 40, 63, 100, 160, 250),
    (20, 29, 46, 72, 115, 185, 290),
    (23, 32, 52, 81, 130, 210, 320),
    (25, 36, 57, 89, 140, 230, 360),
    (27, 40, 63, 97, 155, 250, 400),
)
# [um] upper deviations of shafts d to h and lower deviations of shafts k to p
_DEVIATIONS = {
    "d": (-20, -30, -40, -50, -65, -80, -100, -120, -145, -170, -190, -210, -230),
    "e": (-14, -20, -25, -32, -40, -50, -60, -72, -85, -100, -110, -125, -135),
    "f": (-6, -10, -13, -16, -20, -25, -30, -36, -43, -50, -56, -62, -68),
    "g": (-2, -4, -5, -6, -7, -9, -10, -12, -14, -15, -17, -18, -20),
    "h": (0,) * 13,
    "k": (0, 1, 1, 1, 2, 2, 2, 3, 3, 4, 4, 4, 5),
    "m": (2, 4, 6, 7, 8, 9, 11, 13, 15, 17, 20, 21, 23),
    "n": (4, 8, 10, 12, 15, 17, 20, 23, 27, 31, 34, 37, 40),
    "p": (6, 12, 15, 18, 22, 26, 32, 37, 43, 50, 56, 62, 68),
}
LETTERS = ("d", "e", "f", "g", "h", "js", "k", "m", "n", "p")
_ONE = r"([A-Za-z]{1,2})(\d{1,2})"
_FIT = re.compile(
    rf"\s*(\d+\.?\d*)\s*(?:mm)?\s*{_ONE}\s*/\s*{_ONE}\s*"
    r"(?:\+\s*(\d+\.?\d*(?:e[-+]?\d+)?)\s*um\s*)?"
)
_SIZE = re.compile(rf"\s*(\d+\.?\d*)\s*(?:mm)?\s*{_ONE}\s*")
_UM = 1e-6
_EXPECTED = 'expected a fit such as "12 H7/g6"'
# distance of a limit from the mean in standard deviations, for Cp = 1
_DEVIATIONS_IN_LIMIT = 3.0


class Limits(NamedTuple):
    """Limit deviations of a hole or a shaft from the nominal size [m]."""

    lower: float
    upper: float


@dataclass(frozen=True)
class Fit:
    """Fit between a hole and a shaft of the same nominal size.

    Attributes:
        text: text on the drawing.
        size: nominal diameter [m].
        hole: limit deviations of the hole.
        shaft: limit deviations of the shaft.
        form: additional radial clearance due to form deviations [m], >= 0.
    """

    text: str
    size: float
    hole: Limits
    shaft: Limits
    form: float = 0.0

    @property
    def diametral(self) -> tuple[float, float]:
        """Minimum and maximum diametral clearance [m]; interference is negative."""
        return self.hole.lower - self.shaft.upper, self.hole.upper - self.shaft.lower

    @property
    def kind(self) -> str:
        """Type of the fit: ``"clearance"``, ``"transition"`` or ``"interference"``."""
        least, most = self.diametral
        if least >= 0:
            return "clearance"
        return "transition" if most > 0 else "interference"

    @property
    def radial(self) -> tuple[float, float]:
        """Minimum and maximum radial clearance [m], >= 0.

        The radial clearance is half the diametral clearance plus ``form``.
        """
        least, most = self.diametral
        return max(0.0, least / 2) + self.form, max(0.0, most / 2) + self.form

    @property
    def mean_radial(self) -> float:
        """Radial clearance between a hole and a shaft of mean sizes [m]."""
        return max(0.0, sum(self.diametral) / 4) + self.form

    def draw(
        self, uniform: NDArray, distribution: str = "uniform", cp: float = 1.0
    ) -> NDArray:
        """Draw random radial clearances.

        Args:
            uniform: uniform random numbers between 0 and 1 for the hole and the shaft,
                (k, 2).
            distribution: distribution of the sizes: ``"uniform"`` between the limits,
                or ``"normal"`` without truncation.
            cp: process capability index of normally distributed sizes,
                (upper - lower) / (6 sigma).

        Returns:
            Radial clearances, (k,) [m]; equal to ``form`` in the case of interference.
        """
        from scipy.special import ndtri

        sizes = []
        for column, limits in zip(uniform.T, (self.hole, self.shaft), strict=True):
            middle, half = np.mean(limits), (limits.upper - limits.lower) / 2
            if distribution == "uniform":
                relative = 2.0 * column - 1.0
            else:
                relative = ndtri(np.maximum(column, 2.0**-54))
                relative /= _DEVIATIONS_IN_LIMIT * cp
            sizes.append(middle + half * relative)
        return np.asarray(np.maximum(0.0, (sizes[0] - sizes[1]) / 2) + self.form)


@dataclass(frozen=True)
class FittedEnd:
    """One of two contacts between a hole and a shaft, which limit the rotation.

    The contacts are at both ends of a bore or guide, or in two bearings.

    Attributes:
        length: distance between both contacts [m], > 0. The largest rotation is the
            radial clearance divided by this distance.
        parts: common name of the hole and the shaft.  Contacts with the same name have
            the same clearance.
        bound: rotation that the contact limits: ``"tilt"`` for a bore, or ``"spin"``
            for a guide.
    """

    length: float
    parts: str
    bound: str = "tilt"

    def bounds(self, radial: float) -> dict[str, float]:
        """Return the name of the bound and its value [rad] for a clearance [m]."""
        return {self.bound: radial / self.length}


def parse_fit(text: str) -> Fit:
    """Parse the text of a fit.

    Args:
        text: nominal size in mm, hole and shaft, for example ``"12 H7/g6"``.  A radial
            clearance due to form deviations may follow, as in ``"12 H7/g6 + 5 um"``.

    Returns:
        Clearance, transition or interference fit.

    Raises:
        BadInput: the text is not a fit, or the fit is not in the tables.
    """
    match = _FIT.fullmatch(text)
    if match is None:
        raise BadInput(f"found {quoted(text)}, {_EXPECTED}")
    size, hole, hole_grade, shaft, shaft_grade, form = match.groups()
    if not hole.isupper() or not shaft.islower():
        fault = "capital letters denote holes, small letters denote shafts"
        raise BadInput(f"found {quoted(text)}, {_EXPECTED}: {fault}")
    return Fit(
        text.strip(), float(size) * 1e-3, limits_of(float(size), hole, int(hole_grade)),
        limits_of(float(size), shaft, int(shaft_grade)), float(form or 0.0) * _UM,
    )  # fmt: skip


def clearance_fit(text: str) -> Fit:
    """Return the clearance or transition fit that a text describes.

    Raises:
        BadInput: the text is not a valid fit, or the fit is an interference fit.
    """
    fit = parse_fit(text)
    if fit.kind == "interference":
        least, most = (1e6 * x for x in fit.diametral)
        raise BadInput(
            f"found {quoted(text)}, an interference fit ({least:.0f} to {most:.0f} "
            "um), "
            "expected a clearance or transition fit; for a press fit, use type = "
            '"fixed" without clearance'
        )
    return fit


def parse_hole(text: str) -> tuple[float, Limits]:
    """Return the nominal size and limit deviations [m] of a hole such as ``"12 H7"``.

    Raises:
        BadInput: the text is not a size, or the hole is not in the tables.
    """
    match = _SIZE.fullmatch(text)
    if match is None:
        raise BadInput(f'found {quoted(text)}, expected a size such as "12 H7"')
    if match[2].islower():
        expected = 'expected a hole with a capital letter, such as "12 H7"'
        raise BadInput(f"found {quoted(text)}, a shaft; {expected}")
    return float(match[1]) * 1e-3, limits_of(float(match[1]), match[2], int(match[3]))


def limits_of(size: float, letter: str, grade: int) -> Limits:
    """Return the limit deviations of a hole or a shaft.

    Args:
        size: nominal size [mm], > 0 and <= 500.
        letter: d e f g h js k m n p for a shaft, or the capital letters for a hole.
        grade: 5 to 11, with the exceptions 6 to 8 for K, M and N, and 6 to 7 for P.

    Returns:
        Limit deviations [m].

    Raises:
        BadInput: the tables do not contain this tolerance class.
    """
    name = f"{letter}{grade}"
    small = letter.lower()
    if small not in LETTERS or letter not in (small, small.upper()):
        known = " ".join(LETTERS)
        raise BadInput(
            f"found {quoted(name)}, expected one of the letters {known}, or the "
            "corresponding capital letter for a hole (ISO 286)"
        )
    if grade not in GRADES:
        raise BadInput(f"found {quoted(name)}, expected a grade from 5 to 11 (ISO 286)")
    if not 0 < size <= STEPS[-1]:
        fault = f"found a nominal size of {size:g} mm"
        raise BadInput(f"{fault}, expected over 0 and up to {STEPS[-1]} mm (ISO 286)")
    step = int(np.searchsorted(STEPS, size))
    if letter == small:
        lower, upper = _shaft(step, small, grade)
    else:
        lower, upper = _hole(step, small, grade)
    return Limits(lower * _UM, upper * _UM)


def _width(step: int, grade: int) -> float:
    """Return the tolerance of a grade [um]."""
    return float(_WIDTHS[step][grade - GRADES[0]])


def _shaft(step: int, letter: str, grade: int) -> tuple[float, float]:
    """Return the lower and upper deviation of a shaft [um]."""
    width = _width(step, grade)
    if letter == "js":
        return -width / 2, width / 2
    deviation = float(_DEVIATIONS[letter][step])
    if letter in "defgh":
        return deviation - width, deviation
    if letter == "k" and grade > 7:
        deviation = 0.0
    return deviation, deviation + width


def _hole(step: int, letter: str, grade: int) -> tuple[float, float]:
    """Return the lower and upper deviation of a hole [um]."""
    # For D to H, EI = -es.  For K, M, N and P over 3 mm, ES = -ei + IT(n) - IT(n-1),
    # except for M6 between 250 and 315 mm.
    width = _width(step, grade)
    if letter == "js":
        return -width / 2, width / 2
    deviation = float(_DEVIATIONS[letter][step])
    if letter in "defgh":
        return -deviation, -deviation + width
    finest, coarsest = 6, 7 if letter == "p" else 8
    if not finest <= grade <= coarsest:
        name = f"{letter.upper()}{grade}"
        raise BadInput(
            f"found {quoted(name)}, expected {letter.upper()} with a grade from "
            f"{finest} to {coarsest}, because the table does not contain other grades"
        )
    delta = width - _width(step, grade - 1) if step else 0.0
    upper = -deviation + delta
    if (letter, grade, STEPS[step]) == ("m", 6, 315):
        upper = -9.0
    return upper - width, upper
