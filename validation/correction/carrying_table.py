"""Convert the results of new sessions to plain values and to text."""

from dataclasses import asdict
from typing import Any

from forcefit.results.text import in_unit, readings_text
from forcefit.validation.correction.carrying import CarriedRobot


def table(carried: CarriedRobot) -> dict[str, Any]:
    """Convert sessions, fitted parameters and errors on other rows to plain values."""
    return {
        "machine": {
            "numbers": len(carried.fit.machine.numbers),
            "widened": carried.fit.widened,
        },
        "sessions": [
            {
                "session": one.session,
                "setup_rows": one.rows[0],
                "other_rows": one.rows[1],
                "suffices": one.suffices,
                "open": list(one.open_),
                "uncertainty": one.uncertainty,
                "left_in_setup": one.left,
                "held_in_setup": one.held,
                "left_behind": list(one.left_behind),
                "error": asdict(one.error),
                "declared": asdict(one.declared),
                "parameters": [
                    {"effect": effect, "name": name, "value": value, "std": std}
                    for (effect, name), value, std in zip(
                        one.unknowns.names,
                        one.values.tolist(),
                        one.std.tolist(),
                        strict=True,
                    )
                ],
            }
            for one in carried.sessions
        ],
        "unit": {"position": "m", "rotation": "rad", "uncertainty": "m"},
    }


def text(carried: CarriedRobot) -> str:
    """Format the results of the sessions as text."""
    lines = []
    if carried.fit.machine.numbers:
        lines.append(
            f"fitted robot parameters: {len(carried.fit.machine.numbers)}; their prior "
            f"has {carried.fit.widened:.3g} times the saved covariance"
        )
    for one in carried.sessions:
        name = one.session or "campaign"
        lines.append(f"{name}: {one.rows[0]} set-up rows, {one.rows[1]} other rows")
        lines.append(
            f"  other rows, identified robot: {readings_text(vars(one.error))}"
        )
        lines.append(
            f"  other rows, declared robot: {readings_text(vars(one.declared))}"
        )
        lines.append(
            "  uncertainty after the set-up rows: "
            f"{in_unit(one.uncertainty, 'um')}; residual of the set-up rows: "
            f"{in_unit(one.left, 'um')}, with the robot as saved "
            f"{in_unit(one.held, 'um')}"
        )
        lines += [
            f"  effect of an earlier session that is not used: {title}"
            for title in one.left_behind
        ]
        if not one.suffices:
            lines.append(
                "  the set-up rows are not sufficient to determine "
                f"{', '.join(one.open_)}; measure set-up rows at other positions and "
                "in other orientations"
            )
        elif not one.better:
            lines.append(
                "  the error is larger than that of the declared robot: the "
                "identified robot is not valid in this session"
            )
    return "\n".join(lines)
