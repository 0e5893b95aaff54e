"""Create the report section on the robot under load and weight."""

from typing import Any

import numpy as np

from forcefit.page.page import Tile, paragraph, section
from forcefit.page.tables import Cell, Value, rotation_and_translation, table
from forcefit.stiffness.screws import SCREW, SCREW_UNITS


def service_section(service: dict[str, Any] | None) -> str:
    """Return loads, platform deflection and natural frequencies as HTML.

    Args:
        service: result of :func:`forcefit.validation.study.service.at_pose`; None if it
            was not requested.

    Returns:
        A table for the loads and a table for the frequencies.
    """
    if service is None:
        return ""
    parts = []
    if "solution" in service:
        parts += _loaded(service)
    if "frequencies" in service:
        parts.append(_frequencies(service["frequencies"]))
    return section("The robot under load, at this pose", *parts) if parts else ""


def _loaded(service: dict[str, Any]) -> list[str]:
    """Return a table of the platform's pose error under load and weight."""
    load = ", ".join(f"{v:.6g}" for v in service["load"])
    weight = ", ".join(f"{v:.6g}" for v in service["gravity"])
    about = paragraph(
        f"Load on the platform [{load}] N m, N at its origin, gravity [{weight}] "
        "m/s^2, both in base axes; minimum-energy solution. The certified bounds above "
        "exclude them."
    )
    if "deflection" not in service:
        return [about, paragraph(f"{service['status']}: {service.get('reason', '')}.")]
    solution = service["solution"]
    rows: list[list[Cell]] = [
        [SCREW[k], Value(solution["platform_screw"][k], unit, 6),
         Value(service["deflection"][k], unit, 6)]
        for k, unit in enumerate(SCREW_UNITS)
    ]  # fmt: skip
    head = ["component", "platform error with load and weight",
            "part due to load and weight"]  # fmt: skip
    return [about, table(head, rows, "platform under load")]


def _frequencies(found: dict[str, Any]) -> str:
    """Return a table of natural frequencies with the parts that deform in each mode."""
    if "frequencies" not in found:
        return paragraph(f"Frequencies: {found['status']}, {found['reason']}.")
    rows: list[list[Cell]] = []
    for k, mode in enumerate(found["modes"], 1):
        parts = list(mode["shares"].items())[:3]  # the three largest
        shares = ", ".join(f"{name} {100 * share:.3g} %" for name, share in parts)
        rows.append([str(k), Value(mode["frequency"], "Hz", 5), shares])
    return paragraph(
        "Natural frequencies of the nominal robot without load and weight, with drives "
        "locked and zero clearances."
    ) + table(["mode", "frequency", "where its spring energy is"], rows, "frequencies")


def service_tile(service: dict[str, Any] | None) -> list[Tile]:
    """Return a tile with the deflection under load or the lowest frequency."""
    if service is None:
        return []
    tiles = []
    if "deflection" in service:
        screw = np.asarray(service["deflection"])
        turn, shift = (float(np.linalg.norm(half)) for half in (screw[:3], screw[3:]))
        note = "Platform motion at this pose, minimum-energy solution."
        tiles.append(
            Tile("By load and weight", rotation_and_translation(turn, shift, 3), [note])
        )
    modes = service.get("frequencies", {}).get("modes")
    if modes:
        lowest = Value(modes[0]["frequency"], "Hz", 4)
        tiles.append(Tile("Lowest natural frequency", [lowest], ["Drives held."]))
    return tiles
