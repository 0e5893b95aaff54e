"""Check the JSON output of commands against its schema."""

import json
from functools import cache
from pathlib import Path

from jsonschema import Draft202012Validator

from forcefit.results.outputs import OUTPUTS
from forcefit.results.schema import schema_of


@cache
def validator(name: str) -> Draft202012Validator:
    """Return a validator for the output of a command."""
    return Draft202012Validator(schema_of(OUTPUTS[name]))


def check_schema(words: tuple[str, ...], out: str) -> None:
    """Check the JSON output of a command against its schema.

    Args:
        words: command-line arguments after ``forcefit``.
        out: standard output of the command.
    """
    if "--json" not in words:
        return
    target = words[words.index("--json") + 1]
    if not (out if target == "-" else Path(target).is_file()):
        return  # the command rejected its input
    content = json.loads(out if target == "-" else Path(target).read_text())
    name = next(n for n in OUTPUTS if words[: len(n.split())] == tuple(n.split()))
    if "--diagnose" in words:  # the output is then that of the diagnosis
        name = "validation diagnose"
    errors = list(validator(name).iter_errors(content))
    assert not errors, f"{name}: {errors[0].json_path}: {errors[0].message[:300]}"
