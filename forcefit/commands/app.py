"""Command ``forcefit``, which groups all subcommands, and the command ``study``."""

import io
import signal
import sys
import threading
import warnings
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Annotated

import typer

from forcefit.commands import assembly, report, stiffness, validation
from forcefit.commands.check import check
from forcefit.commands.convert import convert
from forcefit.commands.example import example
from forcefit.commands.help import Commands
from forcefit.commands.new import new
from forcefit.commands.old_names import with_new_names
from forcefit.commands.options import JsonOption
from forcefit.commands.progress import progress_bars, report_loading
from forcefit.commands.schema import schema
from forcefit.inputs.errors import BadInput, one_line, quoted
from forcefit.inputs.packages import naming_packages
from forcefit.inputs.writing import write_json

app = Commands(
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.add_typer(stiffness.app, name="stiffness", help="Stiffness of links.")
app.add_typer(
    assembly.app,
    name="assembly",
    help="Forced assembly: pose, energy, errors, stiffness.",
)
app.add_typer(
    validation.app,
    name="validation",
    help="Validation by simulation and measured data.",
)
app.add_typer(report.app, name="report", help="Comparison of two runs.")
app.command()(check)
app.command()(convert)
app.command()(example)
app.command()(new)
app.command()(schema)


def _print_version(requested: bool) -> None:
    """Print the version and exit."""
    if requested:
        from forcefit import __version__

        print(f"forcefit {__version__}")
        raise typer.Exit


@app.callback()
def forcefit(
    version: Annotated[
        bool,
        typer.Option(
            "--version",
            is_eager=True,
            callback=_print_version,
            help="Show the version and exit.",
        ),
    ] = False,
) -> None:
    """Forced assembly of parallel manipulators, with certified results.

    The commands compute stiffness, energy and pose error in SI units.  Screws are
    ordered [R T] and wrenches [M F]: rotations and moments first.
    """


@app.command()
def study(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Study file (TOML).")],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Output folder.")
    ] = None,
    json: JsonOption = None,
) -> None:
    """Run all checks of a study file and write one report.

    Writes report.html (self-contained), results.json and results.nc.  The study file
    names the output folder, unless --output is given.  The exit status is 1 if a check
    fails.
    """
    from forcefit.validation.study.headline import verdict
    from forcefit.validation.study.report import results_table
    from forcefit.validation.study.run import run_study
    from forcefit.validation.study.study_file import read_study

    requested = read_study(file, output)
    folder = requested.folder
    with progress_bars() as update:
        results = run_study(requested, update, output=folder)
    write_json(results_table(results), json)
    if json != "-":
        print(verdict(results))
        print(f"report: {folder / 'report.html'}")
    if not results.passed:
        raise typer.Exit(1)


def main() -> None:
    """Run the command; on bad input, print one line and exit with status 2."""
    if not sys.warnoptions:
        # Library warnings are meant for programmers, who can enable them with
        # ``python -W default -m forcefit``.
        warnings.simplefilter("ignore")
    _print_any_letter()
    report_loading()
    with _interrupts() as interrupts:
        try:
            with naming_packages():
                # sys.argv is modified in place, so that the command recorded in a
                # report contains the current option names
                sys.argv[1:] = with_new_names(sys.argv[1:])
                status = app(prog_name="forcefit", standalone_mode=False)
        except BaseException as error:
            sys.exit(_status_after(error, interrupted=bool(interrupts)))
    sys.exit(status if isinstance(status, int) else 0)


def _print_any_letter() -> None:
    r"""Print characters outside the encoding of standard output as ``\u03a9``.

    Python already does this for standard error.  On Windows, the default encoding of
    files and pipes contains only 256 characters.
    """
    out = sys.stdout
    if isinstance(out, io.TextIOWrapper) and out.errors == "strict":
        out.reconfigure(errors="backslashreplace")


def _status_after(error: BaseException, interrupted: bool) -> int:
    """Print the message of an exception to stderr and return the exit status."""
    if interrupted or isinstance(error, KeyboardInterrupt | typer.Abort):
        return _complain("interrupted", 130)
    match error:
        case BadInput():
            return _complain(str(error), 2)
        case typer.Exit():
            return error.exit_code
        case BrokenPipeError():
            sys.stderr.close()
            return 1
    # the option parser raises an error with this method for misspelt or missing options
    if not hasattr(error, "format_message"):
        raise error
    # this error contains the help text as its message
    if type(error).__name__ == "NoArgsIsHelpError":
        print(error.format_message(), file=sys.stderr)
        return 2
    return _complain(_with_found(error.format_message(), error), 2)


@contextmanager
def _interrupts() -> Generator[list[int], None, None]:
    """Record whether Ctrl-C was pressed, and raise KeyboardInterrupt as usual.

    Compiled code that is interrupted by Ctrl-C may raise a different error, for example
    ``ValueError: Invalid bounding box`` in matplotlib.  The record shows that the error
    was caused by Ctrl-C.
    """
    recorded: list[int] = []
    usual = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if not usual or threading.current_thread() is not threading.main_thread():
        yield recorded
        return

    def record(number: int, frame: FrameType | None) -> None:
        recorded.append(number)
        signal.default_int_handler(number, frame)

    signal.signal(signal.SIGINT, record)
    try:
        yield recorded
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def _with_found(message: str, error: BaseException) -> str:
    """Append the rejected value to a parser message, because new versions omit it."""
    refused: list[dict] = getattr(error.__cause__, "errors", list)()
    values = [str(one.get("input")) for one in refused[:1] if one.get("input")]
    return "; ".join([message, *(f"found {quoted(v)}" for v in values)])


def _complain(message: str, status: int) -> int:
    """Print a message to stderr unless it is empty, and return the exit status."""
    if message:
        print(f"forcefit: {one_line(message, 800)}", file=sys.stderr)
    return status
