"""Reading and writing of joint clearance and stiffness in robot files."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.callouts.fits import Fit, FittedEnd, clearance_fit
from forcefit.assembly.files.bolt_file import bolt_table
from forcefit.assembly.model.frame import ONE_OF_BALL, SLIDING_BALL
from forcefit.assembly.model.largest import LARGEST, LARGEST_LENGTH
from forcefit.assembly.model.robot import LOCKED, NO_SPIN, Clearance, LockedAt
from forcefit.inputs.number_arrays import find_fault, number_array
from forcefit.inputs.table import BadInput, Table

# [rad, m] smallest positive bound, whose square does not underflow
_LEAST_CLEARANCE = 1e-30
# [m] smallest length of a fit; the tilt increases with decreasing length
_LEAST_LENGTH = 1e-9
LEAST_PITCH = 1e-9  # [m] smallest accepted pitch of a helical joint
LARGEST_PITCH = 1.0  # [m] largest accepted pitch of a helical joint
_CLEARANCE = {"radial": "m", "axial": "m", "tilt": "rad", "spin": "rad", "ball": "m"}


def read_pitch(table: Table, joint: str) -> float:
    """Return the ``pitch`` of a helical joint, or 0 for all other joint types.

    Args:
        table: table of a frame or joint.
        joint: type of the joint.

    Returns:
        Translation per turn [m], positive for a right-hand thread.

    Raises:
        BadInput: the pitch is missing, 0 or above 1 m, or the joint is not helical.
    """
    if joint != "helical":
        if table.has("pitch"):
            expected = "expected none, or a helical joint"
            raise table.bad("pitch", f"found a pitch on a {joint} joint, {expected}")
        return 0.0
    pitch = table.number("pitch", "m per turn", largest=LARGEST_PITCH)
    if abs(pitch) < LEAST_PITCH:
        expected = f"expected a magnitude of at least {LEAST_PITCH:g} m"
        raise table.bad("pitch", f"found {pitch:g}, {expected}")
    return pitch


def read_clearance(table: Table, joint: str) -> Clearance | None:
    """Read the ``clearance`` table of a frame.

    Args:
        table: ``[[frame]]`` table.
        joint: type of the joint.

    Returns:
        Clearance bounds, or None if the table is absent.

    Raises:
        BadInput: a key is unknown, or :func:`read_bounds` rejects a bound.
    """
    if not table.has("clearance"):
        return None
    inner = table.table("clearance")
    end = _fitted_end(inner)
    bounds = read_bounds(inner, joint)
    if end is not None:
        # the fit determines a bound on the rotation, not the radial clearance
        rotation = end.bounds(bounds.radial or 0.0)
        bounds = replace(bounds, radial=None, **rotation)
    inner.finish()
    return bounds


def read_bounds(table: Table, joint: str) -> Clearance:
    """Read the clearance bounds in a ``clearance`` table.

    Args:
        table: ``clearance`` table.
        joint: type of the joint.

    Returns:
        Clearance bounds.

    Raises:
        BadInput: a bound is not a number >= 0, is ``inf`` although the joint is not
            fixed, or is so small that its square underflows, or ``ball`` is specified
            together with another bound on the same motion.
    """
    bounds = {
        key: _bound(table, key, unit, joint)
        for key, unit in _CLEARANCE.items()
        if table.has(key)
    }
    if joint == "helical" and "spin" in bounds:
        raise table.bad("spin", f"found a bound on a helical joint, {NO_SPIN}")
    for key, bound in bounds.items():
        if 0.0 < bound < _LEAST_CLEARANCE:
            expected = f"expected 0 or at least {_LEAST_CLEARANCE:g}"
            raise table.bad(key, f"found {bound:g}, {expected}")
    if fit := fit_of(table):
        bounds["radial"] = fit.mean_radial
    if "ball" in bounds:
        if joint in {"prismatic", "helical"}:
            raise table.bad("ball", SLIDING_BALL)
        for key in ("radial", "axial"):
            if key in bounds:
                given = "fit" if fit and key == "radial" else key
                raise table.bad(given, ONE_OF_BALL)
    return Clearance(**bounds)


def _bound(table: Table, key: str, unit: str, joint: str) -> float:
    """Read a clearance bound; only a fixed joint may have the bound ``inf``."""
    if joint == "fixed" and table.content[key] == math.inf:
        return float(table.get(key))
    return table.number(key, unit, least=0.0, largest=LARGEST_LENGTH)


def read_fit(table: Table) -> str:
    """Return the ISO 286 fit in the ``clearance`` table, or an empty string."""
    content = table.content.get("clearance")
    fit = content.get("fit") if isinstance(content, dict) else None
    return fit.strip() if isinstance(fit, str) else ""


def read_fitted_end(table: Table) -> FittedEnd | None:
    """Return the data of a fit that determines a bound on a rotation, or None."""
    content = table.content.get("clearance")
    if not isinstance(content, dict) or "length" not in content:
        return None
    return _fitted_end(table.table("clearance"))


def _fitted_end(inner: Table) -> FittedEnd | None:
    """Read ``length``, ``parts`` and ``bound`` of a clearance table with a fit."""
    if not inner.has("length"):
        return None
    for key, fault in (("fit", "missing"), ("parts", "missing")):
        if not inner.has(key):
            raise inner.bad(key, f'{fault}; expected together with "length"')
    bound = inner.choice("bound", ("tilt", "spin"), "tilt")
    if inner.has(bound):
        fault = 'found together with "length", which determines the tilt'
        raise inner.bad(bound, f"{fault}; expected only one of them")
    length = inner.number("length", "m", above=_LEAST_LENGTH, largest=LARGEST_LENGTH)
    return FittedEnd(length, inner.text("parts"), bound)


def fit_of(inner: Table) -> Fit | None:
    """Return the fit of a clearance or bearing, or None.

    Raises:
        BadInput: the text is not a clearance fit, or ``radial`` is also specified.
    """
    if not inner.has("fit"):
        return None
    if inner.has("radial"):
        raise inner.bad(
            "radial", 'found together with "fit", expected only one of them'
        )
    text = inner.text("fit", expected='a fit such as "12 H7/g6"')
    try:
        return clearance_fit(text)
    except BadInput as error:
        raise inner.bad("fit", str(error)) from None


def read_joint_stiffness(table: Table, free: int | None = None) -> NDArray | None:
    """Read the stiffness matrix K_B of a joint.

    Args:
        table: ``[[frame]]`` table.
        free: index of the motion of a passive joint, whose row and column may be zero;
            None if the joint is not passive.

    Returns:
        Symmetric matrix, (6, 6) [N m/rad .. N/m]; None if the key is absent.  The
        matrix is positive definite except for a zero row and column.  Its diagonal
        entries may be infinite.

    Raises:
        BadInput: the value has an invalid shape, is not a stiffness, or contains
            ``inf`` along the free motion.
    """
    key = "joint_stiffness"
    if not table.has(key):
        return None
    value = table.content[key]
    zero = "" if free is None else f" (number {free + 1} may be 0: free)"
    expected = f"6 diagonal terms > 0 or inf{zero}, or 6 rows of 6 [N m/rad .. N/m]"
    K = number_array(value)
    if K is None or K.shape not in {(6,), (6, 6)} or np.isnan(K).any():
        shape = (6, 6) if isinstance(value, list) and _has_rows(value) else (6,)
        fault = find_fault(value, shape, infinite=True)
        raise table.bad(key, f"found {fault}, expected {expected}")
    if K.ndim == 1:
        checked = K.copy()
        if free is not None and checked[free] == 0.0:
            checked[free] = 1.0
        if checked.min() <= 0:
            raise table.bad(
                key, f"found the number {checked.min():g}, expected {expected}"
            )
        K = np.diag(K)
    rigid = np.isposinf(np.diag(K))
    if free is not None and rigid[free]:
        raise table.bad(key, LOCKED)
    bare = rigid.copy()
    if free is not None:
        bare[free] = not (K[free].any() or K[:, free].any())
    soft = np.ix_(~bare, ~bare)
    wrong = (rigid[:, None] | rigid) & (K != 0.0) | ~np.isfinite(K)
    wrong &= ~np.diag(rigid)
    if wrong.any():
        i, j = np.argwhere(wrong)[0]
        raise table.bad(
            key,
            f"found {K[i, j]:g} at [{i + 1}, {j + 1}]; expected inf only on the "
            "diagonal, with zeros elsewhere in its row and column",
        )
    K[soft] = definite(table, key, K[soft])
    return K


def _has_rows(value: list) -> bool:
    """Return whether a list contains lists."""
    return any(isinstance(row, list) for row in value)


def definite(table: Table, key: str, K: NDArray) -> NDArray:
    """Check that a stiffness matrix is positive definite, and make it symmetric.

    Args:
        table: table with the matrix.
        key: key of the matrix in the table.
        K: finite stiffness matrix or submatrix, (n, n) [N m/rad .. N/m].

    Returns:
        The symmetric matrix, (n, n).

    Raises:
        BadInput: the matrix is not positive definite.
    """
    if not K.size:
        return K
    diagonal = np.diag(K)
    i = int(np.argmin(diagonal))
    if diagonal[i] <= 0:
        where = f"term [{i + 1}, {i + 1}] of the diagonal"
        raise table.bad(
            key,
            f"not positive definite: found {diagonal[i]:g} as {where}, expected > 0",
        )
    if diagonal.max() > LARGEST or diagonal.min() < 1 / LARGEST:
        i = int(np.argmax(np.abs(np.log(diagonal))))
        expected = f"expected between {1 / LARGEST:g} and {LARGEST:g}"
        fault = f"found {diagonal[i]:g} as term [{i + 1}, {i + 1}]"
        raise table.bad(key, f"{fault}, {expected}")
    # the matrix is scaled to a unit diagonal to be independent of units
    size = np.sqrt(diagonal)
    unit = np.clip(K, -1e150, 1e150) / np.outer(size, size)
    asymmetry = np.abs(unit - unit.T)
    if asymmetry.max() > 1e-6:
        a, b = np.unravel_index(int(np.argmax(asymmetry)), K.shape)
        raise table.bad(
            key,
            f"not symmetric: found [{a + 1}, {b + 1}] = {K[a, b]:.6e} but "
            f"[{b + 1}, {a + 1}] = {K[b, a]:.6e}, expected equal numbers",
        )
    least = np.linalg.eigvalsh((unit + unit.T) / 2).min()
    if least <= 1e-13:
        raise table.bad(
            key,
            f"not positive definite: found {least:.1e} as smallest eigenvalue when "
            "scaled to a unit diagonal, expected > 0",
        )
    return np.where(K == K.T, K, K / 2 + K.T / 2)


def joint_table(
    clearance: Clearance | None, bolt: LockedAt | None, stiffness: NDArray | None
) -> dict[str, Any]:
    """Return the clearance, bolting pose and stiffness of a joint for a robot file.

    Args:
        clearance: operating clearance, or None.
        bolt: pose at which the joint is bolted, with its clearance before bolting.
        stiffness: K_B, (6, 6).  A diagonal matrix is written as a list of six numbers.

    Returns:
        Keys and values.
    """
    table: dict[str, Any] = {}
    clearance = clearance if bolt is None else bolt.clearance
    if clearance is not None:
        given = vars(clearance).items()
        table["clearance"] = {k: v for k, v in given if v is not None}
    if bolt is not None:
        table["locked_at"] = bolt_table(bolt)
    if stiffness is not None:
        diagonal = np.diag(stiffness)
        alone = np.array_equal(stiffness, np.diag(diagonal))
        table["joint_stiffness"] = (diagonal if alone else stiffness).tolist()
    return table
