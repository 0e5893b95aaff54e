"""Final step of a command: write and print its results, and set the exit status."""

from typing import Any

import typer

from forcefit.inputs.writing import write_json


def answer(results: dict[str, Any], text: str, status: str, json: str | None) -> None:
    """Write and print results; exit with status 1 if their status is not ``ok``.

    Args:
        results: results as plain values (dictionaries, lists, numbers and strings).
        text: the same results, formatted for the terminal.
        status: status of the results, for example ``"ok"``.
        json: path for the JSON output, ``"-"`` for standard output, or None.

    Raises:
        typer.Exit: the status is not ``ok``.
    """
    from forcefit.assembly.model.statuses import OK

    write_json(results, json)
    if json != "-":
        print(text)
    if status != OK:
        raise typer.Exit(1)
