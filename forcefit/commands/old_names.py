"""Deprecated names of commands and options, supported for one more release.

The commands themselves accept only the new names, and ``--help`` lists only the new
names.  Using a deprecated name prints a message, except for names that are still part
of a public file format.
"""

import sys
from collections.abc import Sequence

from forcefit.inputs.errors import BadInput

# replacement of each deprecated command
COMMANDS: dict[str, tuple[str, ...]] = {
    "assembly exact": ("assembly", "solve", "--state", "exact"),
    "assembly zone": ("assembly", "solve", "--quantities", "margin"),
    "assembly table": ("assembly", "plot"),
    "stiffness curve": ("stiffness", "beam"),
    "stiffness solids": ("stiffness", "fea", "--part", "list"),
    "stiffness slenderness": ("stiffness", "compare", "--ratios", "5,10,20,40"),
    "stiffness import": ("stiffness", "convert"),
    "stiffness export": ("stiffness", "convert"),
    "stiffness library build": ("stiffness", "library"),
    "stiffness library read": ("stiffness", "library"),
    "stiffness library list": ("stiffness", "library"),
    "stiffness library look-up": ("stiffness", "library"),
    "stiffness library export": ("stiffness", "library", "--to", "csv"),
    "validation iso": ("validation", "inspect", "--iso"),
}
_PICTURE: dict[str, tuple[str, ...]] = {"-o": ("--figure",), "--output": ("--figure",)}
# For each command, its deprecated options and their replacements.  The value of an
# option is appended to the replacement.
OPTIONS: dict[str, dict[str, tuple[str, ...]]] = {
    "assembly error": {
        "--reading": ("--assumption",),
        "--point": ("--at",),
        "--direction": ("--along",),
    },
    "assembly show": _PICTURE | {"--reading": ("--assumption",)},
    "assembly stiffness": _PICTURE
    | {
        "--exact": ("--state", "exact"),
        "--direction": ("--along",),
    },
    "assembly frequencies": {"--exact": ("--state", "exact")},
    "assembly sweep": {
        "--stiffness": ("--state", "nominal"),
        "--tangent": ("--state",),
        "--play-alone": (
            "--quantities",
            "default,rotation_error_clearance,translation_error_clearance",
        ),
        "--linearisation": (
            "--quantities",
            "default,linearisation_rotation,linearisation_translation,"
            "linearisation_energy",
        ),
        "--reading": ("--assumption",),
    },
    "assembly statistics": {"--stiffness": ("--state",), "--play": ("--clearance",)},
    "assembly tolerances": {
        "--play": ("--clearance",),
        "--compliant": ("--quantities",),
        "--fresh": ("--draws",),
    },
    "assembly deflection": _PICTURE | {"--exact": ("--state", "exact")},
    "assembly table": {"-o": ("--csv",), "--output": ("--csv",)},
    "assembly plot": _PICTURE | {"--quantity": ("--quantities",)},
    "report compare": {"-o": ("--report",), "--output": ("--report",)},
    "validation crosscheck": {
        "--clearances": ("--with-clearance",),
        "--stiffness": ("--state", "exact"),
    },
    "validation generate": {"--point": ("--at",)},
    "validation plan": {"--point": ("--at",)},
    "stiffness beam": {"--axis": ("--along",)},
    "stiffness stress": {"--wrench": ("--load",)},
}

# for each option, its deprecated values and their replacements
VALUES = {"--compliant": {"free": "margin_free", "rigid": "margin"}}
STAY = {("assembly error", "--reading"), ("stiffness beam", "--axis")}


def with_new_names(words: Sequence[str]) -> list[str]:
    """Replace old names of commands and options with the new names.

    Each replacement is reported once on stderr.

    Args:
        words: command-line arguments, without the program name.

    Returns:
        Command-line arguments that contain new names only.
    """
    renamed = _renamed_options(words)
    end = words.index("--") if "--" in words else len(words)
    reported: list[str] = []
    new_words: list[str] = []
    values: dict[str, str] = {}  # replacements for the value of the option
    for word in words[:end]:
        word, values = values.get(word, word), {}
        option, equals, value = _parts(word)
        if option not in renamed:
            new_words.append(word)
            continue
        new = renamed[option]
        if option not in reported and option not in _staying(words):
            print(f"forcefit: {option} is now {' '.join(new)}", file=sys.stderr)
        reported.append(option)
        of_option = VALUES.get(option, {})
        values = {} if equals else of_option
        new_words += [*new[:-1], new[-1] + equals + of_option.get(value, value)]
    return _with_new_command(new_words) + list(words[end:])


def _with_new_command(words: list[str]) -> list[str]:
    """Replace the name of a command that was merged into another command."""
    for old, new in COMMANDS.items():
        count = len(old.split())
        if words[:count] == old.split():
            print(f"forcefit: {old} is now {' '.join(new)}", file=sys.stderr)
            if old.endswith("look-up") and not any(w.startswith("--at") for w in words):
                raise BadInput(
                    "--at: missing; expected parameters such as radius=0.02,length=0.4"
                )
            return [*new, *words[count:]]
    return words


def _parts(word: str) -> tuple[str, str, str]:
    """Split an argument into option, "=" and value; ``-ofile`` is split as well."""
    if word.startswith("--") or not word.startswith("-"):
        return word.partition("=")
    return word[:2], "=" * bool(word[2:]), word[2:]


def _staying(words: Sequence[str]) -> list[str]:
    """Return old options of the command that are still used in public file formats."""
    return [old for command, old in STAY if list(words[:2]) == command.split()]


def _renamed_options(words: Sequence[str]) -> dict[str, tuple[str, ...]]:
    """Return the old options of the given command and their replacements."""
    renamed: dict[str, tuple[str, ...]] = {}
    for command, options in OPTIONS.items():
        path = command.split()
        if list(words[: len(path)]) == path:
            renamed |= options
    return renamed
