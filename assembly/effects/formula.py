"""User-defined formulas and their units.

A formula consists of numbers, names, ``+ - * / **``, brackets, ``pi`` and a few
functions.  The terms of a sum must have the same unit, and the argument of a function
must be dimensionless.  The units of the parameters follow from these conditions.  The
unit rad is dimensionless.

Sources:
    Kennedy, Relational Parametricity and Units of Measure, POPL 1997 (units of
    unknowns as linear equations in exponents).
"""

import ast
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from forcefit.inputs.errors import BadInput, describe, nearest, quoted

FUNCTIONS: dict[str, Callable[[NDArray], NDArray]] = {
    "sin": np.sin, "cos": np.cos, "tan": np.tan, "atan": np.arctan, "exp": np.exp,
    "log": np.log, "tanh": np.tanh, "sqrt": np.sqrt, "abs": np.abs, "sign": np.sign,
}  # fmt: skip
_OPERATIONS: dict[type, Callable[[NDArray, NDArray], NDArray]] = {
    ast.Add: np.add, ast.Sub: np.subtract, ast.Mult: np.multiply,
    ast.Div: np.divide, ast.Pow: np.power,
}  # fmt: skip
_LONGEST = 500  # largest number of characters in a formula
_DEEPEST = 50  # largest depth of nested brackets and operations
_SAME = 1e-9  # tolerance for the comparison of unit exponents
# exponents of the units m, N, s, K .. in a unit; rad is dimensionless
Unit = Mapping[str, float]


def parse_formula(text: str) -> ast.expr:
    """Parse a formula into its syntax tree.

    Args:
        text: formula such as ``"a*sin(3*q) + b"``.

    Returns:
        The syntax tree.

    Raises:
        BadInput: the text is not a valid formula.
    """
    if len(text) > _LONGEST:
        raise BadInput(f"found {len(text)} characters, expected at most {_LONGEST}")
    try:
        tree = ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, MemoryError, RecursionError):
        given = describe(text)
        raise BadInput(
            f'found {given}, expected a formula such as "a*sin(q)"'
        ) from None
    _check(tree, 0)
    return tree


def _check(node: ast.AST, depth: int) -> None:
    """Raise BadInput for syntax that formulas do not support."""
    match node:
        case _ if depth > _DEEPEST:
            raise BadInput(f"found a formula nested deeper than {_DEEPEST}")
        case ast.Constant(value=int() | float() as x) if not isinstance(x, bool):
            if not abs(x) < 1e100:
                raise BadInput("found a number above 1e100 in the formula")
        case ast.Name():
            pass
        case ast.UnaryOp(op=ast.UAdd() | ast.USub(), operand=inner):
            _check(inner, depth + 1)
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _OPERATIONS:
            _check(left, depth + 1)
            _check(right, depth + 1)
        case ast.Call(func=ast.Name(id=name), args=[inner], keywords=[]):
            if name not in FUNCTIONS:
                hint = nearest(name, FUNCTIONS)
                raise BadInput(
                    f"found {quoted(name)}, expected the name of a function{hint}"
                )
            _check(inner, depth + 1)
        case _:
            part = quoted(ast.unparse(node))
            allowed = f"+ - * / **, brackets and {', '.join(FUNCTIONS)} of one number"
            raise BadInput(f"found {part} in the formula, expected {allowed}")


def names_in(tree: ast.expr) -> list[str]:
    """Return the names of variables and parameters, in order of appearance."""
    called = {id(n.func) for n in ast.walk(tree) if isinstance(n, ast.Call)}
    nodes = [n for n in ast.walk(tree) if isinstance(n, ast.Name)]
    nodes.sort(key=lambda n: n.col_offset)
    names = (n.id for n in nodes if id(n) not in called and n.id != "pi")
    return list(dict.fromkeys(names))


def evaluate(tree: ast.expr, known: Mapping[str, NDArray]) -> NDArray:
    """Evaluate a formula.

    Args:
        tree: syntax tree of the formula.
        known: values of variables and parameters by name: numbers, or arrays (R,).

    Returns:
        (R,) values, or a number; inf or NaN where the formula is undefined.
    """
    with np.errstate(all="ignore"):
        return _value(tree, known)


def _value(node: ast.AST, known: Mapping[str, NDArray]) -> NDArray:
    match node:
        case ast.Constant(value=value):
            assert isinstance(value, int | float)
            return np.asarray(float(value))
        case ast.Name(id=name):
            return np.asarray(math.pi if name == "pi" else known[name])
        case ast.UnaryOp(op=op, operand=inner):
            sign = -1.0 if isinstance(op, ast.USub) else 1.0
            return sign * _value(inner, known)
        case ast.BinOp(left=left, op=op, right=right):
            return _OPERATIONS[type(op)](_value(left, known), _value(right, known))
        case ast.Call(func=ast.Name(id=name), args=[inner]):
            return FUNCTIONS[name](_value(inner, known))
    raise AssertionError(type(node).__name__)


def parameter_units(
    tree: ast.expr, variables: Mapping[str, Unit], result: Unit
) -> dict[str, Unit]:
    """Return the units of the parameters of a formula.

    Args:
        tree: syntax tree of the formula.
        variables: units of its variables by name.
        result: unit of the result; a dimensionless result is interpreted in SI units.

    Returns:
        Unit exponents by parameter.  An undetermined unit is dimensionless.

    Raises:
        BadInput: the units of the formula are inconsistent.
    """
    units = _Units(variables)
    whole = units.of(tree)
    number = units.reduced(whole)
    if any(abs(k) > _SAME for k in number.values()):
        units.equal(whole, dict(result), ast.unparse(tree))
    return units.of_parameters([n for n in names_in(tree) if n not in variables])


@dataclass
class _Units:
    """Equations between units, in which ``?name`` is the unit of a parameter."""

    variables: Mapping[str, Unit]
    known: dict[str, dict[str, float]] = field(default_factory=dict)

    def of(self, node: ast.AST) -> dict[str, float]:
        """Return the unit of a subexpression; raise BadInput if units conflict."""
        match node:
            case ast.Name(id=name) if name in self.variables:
                return dict(self.variables[name])
            case ast.Name(id=name) if name != "pi":
                return {f"?{name}": 1.0}
            case ast.UnaryOp(operand=inner):
                return self.of(inner)
            case ast.BinOp(left=left, op=ast.Add() | ast.Sub(), right=right):
                one = self.of(left)
                self.equal(one, self.of(right), ast.unparse(node))
                return one
            case ast.BinOp(left=left, op=ast.Pow(), right=right):
                self.equal(self.of(right), {}, ast.unparse(right))
                base, power = self.of(left), _number(right)
                if power is None:
                    self.equal(base, {}, ast.unparse(left))
                    return {}
                return {name: k * power for name, k in base.items()}
            case ast.BinOp(left=left, op=op, right=right):
                sign = -1.0 if isinstance(op, ast.Div) else 1.0
                return _added(self.of(left), self.of(right), sign)
            case ast.Call(func=ast.Name(id=name), args=[inner]):
                unit = self.of(inner)
                if name == "abs":
                    return unit
                if name == "sqrt":
                    return {key: k / 2 for key, k in unit.items()}
                if name != "sign":
                    self.equal(unit, {}, ast.unparse(inner))
        return {}

    def reduced(self, unit: Mapping[str, float]) -> dict[str, float]:
        """Replace the units of parameters in a unit by their known values."""
        reduction: dict[str, float] = {}
        for name, k in unit.items():
            reduction = _added(reduction, self.known.get(name, {name: 1.0}), k)
        return {name: k for name, k in reduction.items() if abs(k) > _SAME}

    def equal(
        self, one: Mapping[str, float], other: Mapping[str, float], where: str
    ) -> None:
        """Equate two units and solve for the unit of a parameter."""
        left = self.reduced(_added(one, other, -1.0))
        free = next((name for name in left if name.startswith("?")), None)
        if free is not None:
            share = left.pop(free)
            self.known[free] = {name: -k / share for name, k in left.items()}
            self.known = {name: self.reduced(unit) for name, unit in self.known.items()}
        elif left:
            pair = [unit_text(self.reduced(unit)) for unit in (one, other)]
            raise BadInput(
                f"units clash in {quoted(where)}: found {pair[0]}, expected {pair[1]}"
            )

    def of_parameters(self, names: list[str]) -> dict[str, Unit]:
        """Return the units of parameters, dimensionless if undetermined."""
        reduced = {name: self.reduced({f"?{name}": 1.0}) for name in names}
        return {
            name: {k: v for k, v in unit.items() if not k.startswith("?")}
            for name, unit in reduced.items()
        }


def _number(node: ast.AST) -> float | None:
    """Return the value of a subexpression, or None if it contains names."""
    if any(isinstance(n, ast.Name) and n.id != "pi" for n in ast.walk(node)):
        return None
    return float(_value(node, {}))


def _added(
    one: Mapping[str, float], other: Mapping[str, float], factor: float
) -> dict[str, float]:
    """Return the exponents of the product of a unit and a power of another unit."""
    names = dict.fromkeys([*one, *other])
    return {name: one.get(name, 0.0) + factor * other.get(name, 0.0) for name in names}


def unit_text(unit: Unit) -> str:
    """Return a unit as text, such as ``1/N^2``, or ``1`` if dimensionless."""

    def powers(sign: float) -> list[str]:
        parts = [(name, sign * k) for name, k in unit.items() if sign * k > _SAME]
        return [n if abs(k - 1) < _SAME else f"{n}^{k:g}" for n, k in parts]

    above, below = " ".join(powers(1.0)) or "1", powers(-1.0)
    if not below:
        return above
    return f"{above}/{below[0] if len(below) == 1 else '(' + ' '.join(below) + ')'}"
