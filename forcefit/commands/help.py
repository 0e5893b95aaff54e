"""Command-line help that lists the options in titled groups."""

from typing import Any

import typer
from typer.core import TyperCommand

_WHAT = "What"  # title of the group of all options that are not listed below
GROUPS = {
    "Where": (
        "pose joint grid poses path rest mismatch under at along over base tip nodes "
        "configurations reach stroke setup"
    ),
    "How sure": (
        "accuracy tolerance-rotation tolerance-translation energy-budget draws seed "
        "confidence calibrate importance scale rotation position diagnosed"
    ),
    "Output": "output figure report csv json save offsets truth exaggeration to",
    "Run": "workers scheduler time-limit help",
}
_GROUP_OF = {
    f"--{name}": title for title, names in GROUPS.items() for name in names.split()
}


class GroupedCommand(TyperCommand):
    """Command whose help lists its options in groups."""

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write the arguments followed by each group of options."""
        rows: dict[str, list[tuple[str, str]]] = {
            title: [] for title in ("Arguments", _WHAT, *GROUPS)
        }
        for param in self.get_params(ctx):
            record = param.get_help_record(ctx)
            if record is not None:
                rows[_title_of(param)].append(record)
        for title, records in rows.items():
            if records:
                with formatter.section(title):
                    formatter.write_dl(records)


class Commands(typer.Typer):
    """Command group whose commands list their options in groups."""

    def command(self, name: str | None = None, **settings: Any) -> Any:
        """Register a command; see :meth:`typer.Typer.command` for the arguments."""
        return super().command(name, cls=GroupedCommand, **settings)


def _title_of(param: Any) -> str:
    """Return the title of the help group that lists a parameter."""
    if param.param_type_name == "argument":
        return "Arguments"
    groups = [_GROUP_OF[name] for name in param.opts if name in _GROUP_OF]
    return groups[0] if groups else _WHAT
