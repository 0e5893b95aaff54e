"""Command ``forcefit check``: report all mistakes in input files."""

import os.path
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from forcefit.commands.options import JsonOption
from forcefit.inputs.errors import BadInput
from forcefit.inputs.writing import write_json

if TYPE_CHECKING:
    from forcefit.assembly.model.robot import Robot

_KINDS = "robot, study, campaign, tolerance plan or errors"


def check(
    files: Annotated[
        list[Path],
        typer.Argument(
            metavar="FILE...",
            help="Robots (also URDF, MJCF, SDF), studies, campaigns (folders), "
            "tolerance plans, error distributions.",
        ),
    ],
    robot: Annotated[
        str | None,
        typer.Option(
            help="Robot whose frames are named in tolerance plans and errors: a file "
            "or a built-in name."
        ),
    ] = None,
    json: JsonOption = None,
) -> None:
    """Print all mistakes in files, not only the first.

    No results are computed.  The messages are those that a command would print when
    reading the file.  The exit status is 2 if a mistake is found.
    """
    results = [_checked(file, robot) for file in files]
    passed = not any(one["messages"] for one in results)
    write_json({"passed": passed, "files": results}, json)
    if json != "-":
        for one in results:
            print(_text(one))
    if not passed:
        raise typer.Exit(2)


def _checked(file: Path, robot: str | None) -> dict[str, Any]:
    """Return the type of a file and all messages about it."""
    from forcefit.inputs.mending import all_messages

    try:
        kind, read = _reader(file, robot)
    except BadInput as error:
        return {"file": str(file), "kind": "", "messages": [str(error)]}
    return {"file": str(file), "kind": kind, "messages": all_messages(read)}


def _text(one: dict[str, Any]) -> str:
    """Format the messages about one file for the terminal."""
    from forcefit.inputs.mending import MOST_MESSAGES

    messages = one["messages"]
    if not messages:
        return f"ok: {one['file']}: {one['kind']}"
    if len(messages) < MOST_MESSAGES:
        return "\n".join(messages)
    return "\n".join([*messages, f"{one['file']}: there may be more mistakes"])


def _reader(file: Path, robot: str | None) -> tuple[str, Callable[[], object]]:
    """Return the type of a file and a function that reads it.

    Raises:
        BadInput: the file type is unknown, or the file requires ``--robot``, which is
            missing.
    """
    from forcefit.inputs.table import read_toml

    if os.path.isdir(file):
        return _campaign(file)
    if file.suffix.lower() in {".urdf", ".xml", ".sdf"}:
        return "robot", lambda: _robot(file)
    content = read_toml(file).content
    if {"frame", "body", "joint", "leg"} & set(content):
        return "robot", lambda: _robot(file)
    if "measurements" in content:
        return _campaign(file)
    if "tolerance" in content:
        from forcefit.assembly.statistics.tolerance_file import read_plan

        known = _robot_for(file, robot)
        return "tolerance plan", lambda: read_plan(file, known)
    if isinstance(content.get("errors"), list):
        from forcefit.assembly.model.error_distributions import read_sources

        known = _robot_for(file, robot)
        return "errors", lambda: read_sources(file, known)
    if "robot" in content:
        from forcefit.validation.study.study_file import read_study

        return "study", lambda: read_study(file, links=False)
    if "platform" in content:
        return "robot", lambda: _robot(file)
    raise BadInput(f"{file}: found an unknown type of file, expected a {_KINDS}")


def _campaign(folder: Path) -> tuple[str, Callable[[], object]]:
    """Return ``"campaign"`` and a function that reads the folder."""
    from forcefit.validation.campaign.campaign_file import read_campaign

    return "campaign", lambda: read_campaign(folder, links=False)


def _robot(name: Path | str) -> "Robot":
    """Load a robot with its link libraries, but without solving its meshes."""
    from forcefit.assembly.exchange.robot_files import load_robot
    from forcefit.assembly.model.robot import MeshLink

    robot = load_robot(name, links=False)
    if any(isinstance(frame.link, MeshLink) for frame in robot.frames):
        return robot
    return load_robot(name)


def _robot_for(file: Path, robot: str | None) -> "Robot":
    """Load the robot that defines the frames named in a file."""
    if robot is None:
        raise BadInput(
            f"{file}: found frame names; expected --robot ROBOT, which defines these "
            "frames"
        )
    return _robot(robot)
