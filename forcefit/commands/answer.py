"""Last step of a command: results are written and printed, the exit status is set."""

from typing import Any

import typer

from forcefit.inputs.writing import write_json


def answer(results: dict[str, Any], text: str, status: str, json: str | None) -> None:
    """Write and print results; exit with status 1 if their status is not ok.

    Args:
        results: plain values.
        text: the results as text.
        status: status of the results.
        json: target of the JSON, as in ``write_json``.

    Raises:
        typer.Exit: the status is not ok.
    """
    from forcefit.assembly.model.statuses import OK

    write_json(results, json)
    if json != "-":
        print(text)
    if status != OK:
        raise typer.Exit(1)
