"""JSON Schema (draft 2020-12) of outputs and input files, generated from their records.

Values in an output may be null.  Null represents a number that is not finite, or a
result that is missing because a computation failed.
"""

from typing import Any

from forcefit.results.quantities import LABELS, QUANTITIES, Quantity
from forcefit.results.records import (
    Anything,
    Content,
    Each,
    Either,
    Listed,
    Record,
    WithUnits,
    Words,
)

DRAFT = "https://json-schema.org/draft/2020-12/schema"


def schema_of(content: Content, title: str = "", file: bool = False) -> dict[str, Any]:
    """Return the JSON Schema of a record.

    Args:
        content: declared type, usually a record.
        title: title of the schema.
        file: whether the schema is for a TOML input file, which cannot contain null.

    Returns:
        Schema as plain values.
    """
    schema = _schema(content)
    return {"$schema": DRAFT, "title": title} | (
        _without_null(schema) if file else schema
    )


def _without_null(schema: Any) -> Any:
    """Remove null from the types allowed by a schema."""
    if isinstance(schema, list):
        return [_without_null(one) for one in schema]
    if not isinstance(schema, dict):
        return schema
    plain = {key: _without_null(one) for key, one in schema.items()}
    if isinstance(schema.get("type"), list):
        plain["type"] = schema["type"][0]
    return plain


def _schema(content: Content) -> dict[str, Any]:
    """Return the schema of a declared type."""
    match content:
        case str():
            return _schema(QUANTITIES[content])
        case Quantity():
            return _described(_array(content, content.dims), content)
        case Words(words):
            return {"enum": list(words)}
        case Each(inner):
            return {"type": ["object", "null"], "additionalProperties": _schema(inner)}
        case Listed(inner):
            return {"type": ["array", "null"], "items": _schema(inner)}
        case Either(contents):
            return {"anyOf": [_schema(one) for one in contents]}
        case Anything():
            return {}
        case WithUnits(inner):
            return _with_texts(_schema(inner))
        case Record():
            return _object(content)


def _with_texts(schema: Any) -> Any:
    """Allow a string in place of each number in a schema."""
    if isinstance(schema, list):
        return [_with_texts(one) for one in schema]
    if not isinstance(schema, dict):
        return schema
    changed = {key: _with_texts(one) for key, one in schema.items()}
    if schema.get("type") == ["number", "null"]:
        kinds = [{"type": ["number", "null"]}, {"type": ["string", "null"]}]
        changed = {**changed, "anyOf": kinds}
        del changed["type"]
    return changed


def _object(content: Record) -> dict[str, Any]:
    """Return the schema of an object with declared keys."""
    one: dict[str, Any] = {
        "type": ["object", "null"],
        "properties": {key: _schema(inner) for key, inner in content.content.items()},
    }
    required = [key for key in content.content if key not in content.optional]
    return (
        one
        | ({"required": required} if required else {})
        | ({"additionalProperties": False} if content.closed else {})
    )


def _array(one: Quantity, dims: tuple[str, ...]) -> dict[str, Any]:
    """Return the schema of an array with the given dimensions."""
    if not dims:
        return {"type": [one.kind, "null"]}
    length = len(LABELS.get(dims[0], ()))
    size = {"minItems": length, "maxItems": length} if length else {}
    whole = ["array", "null"] if dims == one.dims else "array"
    return {"type": whole, "items": _array(one, dims[1:]), **size}


def _described(schema: dict[str, Any], one: Quantity) -> dict[str, Any]:
    """Add the name, meaning and unit of a quantity to its schema."""
    words = f"{one.words}: {one.meaning}" if one.meaning else one.words
    unit = "" if one.unit in {"", "1"} or one.kind != "number" else f" [{one.unit}]"
    return schema | {"description": words + unit}
