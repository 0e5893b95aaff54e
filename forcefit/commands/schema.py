"""Command ``forcefit schema``."""

import json
from typing import Annotated

import typer

from forcefit.commands.old_names import with_new_names
from forcefit.inputs.errors import BadInput, nearest, quoted


def schema(
    name: Annotated[
        list[str] | None,
        typer.Argument(
            help="Name of the schema: robot, campaign, steps, or a command such as "
            "assembly solve. If omitted, all names are listed."
        ),
    ] = None,
) -> None:
    """Print the JSON Schema of robot files, campaigns or results.

    Editors can use a schema to complete and check files. To store the schema of robot
    files, run forcefit schema robot > robot.schema.json
    """
    from forcefit.assembly.files.robot_schema import ROBOT_FILE
    from forcefit.assembly.files.step_file import PLAN_FILE
    from forcefit.results.outputs import OUTPUTS
    from forcefit.results.records import Content
    from forcefit.results.schema import schema_of
    from forcefit.validation.campaign.campaign_schema import CAMPAIGN_FILE

    files: dict[str, Content] = {"robot": ROBOT_FILE, "campaign": CAMPAIGN_FILE}
    known: dict[str, Content] = {**files, **OUTPUTS, "steps": PLAN_FILE}
    if not name:
        print("\n".join(known))
        return
    wanted = " ".join(with_new_names(name)).partition(" --")[0]
    if wanted not in known:
        raise BadInput(f"schema: found {quoted(wanted)}{nearest(wanted, known)}")
    is_file = wanted in {*files, "steps"}
    result = schema_of(known[wanted], f"forcefit {wanted}", file=is_file)
    print(json.dumps(result, indent=1))
