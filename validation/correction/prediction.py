"""Predict the readings of a robot for given commands."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.effects.registration import BASE
from forcefit.assembly.measurement.conditions import Conditions
from forcefit.assembly.measurement.predict import Prediction
from forcefit.assembly.measurement.predict import predict as predict_rows
from forcefit.assembly.model.robot import Robot
from forcefit.inputs.errors import BadInput
from forcefit.results.display import html_table, short_repr
from forcefit.results.quantities import text
from forcefit.validation.campaign.campaign import READING, Campaign
from forcefit.validation.campaign.tables import row_dataset, screw
from forcefit.validation.correction.spread import deviation_spread
from forcefit.validation.diagnosis.learned_range import beyond_by_row
from forcefit.validation.diagnosis.prediction import finite_conditions
from forcefit.validation.diagnosis.registration import register
from forcefit.validation.diagnosis.sequence import Errors, errors_of, rms
from forcefit.validation.diagnosis.unknowns import effects_in, with_effects_in

if TYPE_CHECKING:
    import pandas
    import xarray

# Smallest ratio of the residuals for the saved device pose and for a fitted pose that
# shows that the device was moved.
_MOVED = 3.0


@dataclass(frozen=True, eq=False)
class PredictedReadings:
    """Predicted readings of a robot for given commands.

    Attributes:
        commands: the commands, R rows.
        prediction: the predicted readings.
        error: measured readings minus predicted readings; NaN for components that were
            not measured.
        spread: (R, 6) [rad, m] standard deviation of the prediction due to the
            uncertainty in the robot file.
        noise: (R, 6) [rad, m] standard deviation of the measurement noise; NaN if it is
            unknown.
        extrapolated: (R,) names of the variables with values outside the range in which
            the robot was identified; empty if there are none.
        registration: source of the pose of the measuring device: ``"known"``, ``"of the
            robot file"``, ``"fitted to these rows"`` or ``"none"``.
        point: position [m] of the measured point with which the robot was identified.
            None if the predicted readings are of the same point.
    """

    commands: Campaign
    prediction: Prediction
    error: Errors
    spread: NDArray
    noise: NDArray
    extrapolated: NDArray
    registration: str
    point: tuple[float, float, float] | None

    __repr__, _repr_html_ = short_repr, html_table

    def to_xarray(self) -> "xarray.Dataset":
        """Convert measured and predicted readings to a data set over ``row``."""
        return row_dataset(
            self.commands,
            {
                "reading": self.commands.measured,
                "predicted": (screw("predicted reading"), self.prediction.deviation),
                "spread": (screw("standard deviation of the prediction"), self.spread),
                "noise": (screw("standard deviation of a reading"), self.noise),
                "extrapolated": (text("extrapolated variables"), self.extrapolated),
                "reason": (text("reason"), self.prediction.reason),
            },
        )

    def to_pandas(self) -> "pandas.DataFrame":
        """Convert to a pandas table with one row per reading."""
        from forcefit.assembly.model.tables import frame_table

        return frame_table(self.to_xarray(), "row")

    def table(self) -> dict[str, Any]:
        """Convert the predictions to plain values."""
        rows = zip(self.commands.ids, self.prediction.reason, strict=True)
        far = zip(self.commands.ids, self.extrapolated, strict=True)
        missing = list(self.commands.robot.diagnosis.get("not_measured", []))
        known = np.where([name in missing for name in READING], np.nan, 1.0)
        return {
            "rows": len(self.commands),
            "without_answer": [{"id": i, "reason": why} for i, why in rows if why],
            "open": int(self.prediction.undetermined.sum()),
            "registration": self.registration,
            "reference_point": self.commands.reference_point.tolist(),
            "identified_at": None if self.point is None else list(self.point),
            "extrapolated": [{"id": i, "variables": why} for i, why in far if why],
            "std": _both(known * self.spread),
            "noise": _both(known * self.noise),
            "not_measured": missing,
            "error": {
                "unit": {"position": "m", "rotation": "rad"},
                **asdict(self.error),
            },
        }  # fmt: skip


def _both(values: NDArray) -> dict[str, float]:
    """Return the root mean square of the positions [m] and of the rotations [rad]."""
    return {"position": rms(values[:, 3:]), "rotation": rms(values[:, :3])}


def predict(commands: Campaign) -> PredictedReadings:
    """Return the predicted readings of a campaign's robot for its commands.

    The registration is the pose of the measuring device. If the campaign does not
    contain the registration, it is read from the robot file. If the file does not
    contain it either, or if the residuals show that the device was moved, it is fitted
    to the measured rows.

    Args:
        commands: campaign with the robot, its effects and its rows.

    Returns:
        The predicted readings and their uncertainty.

    Raises:
        BadInput: the registration is unknown and the rows do not determine it.
    """
    conditions, registration = _registered(commands, finite_conditions(commands))
    prediction = predict_rows(conditions)
    robot = commands.robot

    def placed(other: Robot) -> Conditions:
        changed = finite_conditions(replace(commands, robot=other))
        if registration == _FITTED:
            return replace(changed, base=conditions.base)
        return changed

    identified = robot.reference_point
    same = identified is None or np.allclose(identified, commands.reference_point)
    return PredictedReadings(
        commands=commands,
        prediction=prediction,
        error=errors_of(commands, commands.measured - prediction.deviation),
        spread=deviation_spread(robot, placed),
        noise=_noise(commands),
        extrapolated=beyond_by_row(robot, commands),
        registration=registration,
        point=None if same else identified,
    )


_FITTED = "fitted to these rows"


def _registered(commands: Campaign, conditions: Conditions) -> tuple[Conditions, str]:
    """Return the conditions with the device pose, and the source of that pose."""
    if commands.registration == "known":
        return conditions, "known"
    carried = np.broadcast_to(conditions.base, (len(commands), 6)).any(axis=1).all()
    measured = commands.cells.any(axis=1)
    if not measured.any():
        return conditions, "of the robot file" if carried else "none"
    if not carried:
        return register(commands.take(measured), conditions), _FITTED
    bare = replace(commands, robot=_unplaced(commands.robot))
    try:
        again = register(bare.take(measured), finite_conditions(bare))
    except BadInput:
        return conditions, "of the robot file"
    errors = [
        rms((commands.measured - predict_rows(one).deviation) / commands.sigma)
        for one in (conditions, again)
    ]
    if errors[0] > _MOVED * errors[1]:
        return again, _FITTED
    return conditions, "of the robot file"


def _unplaced(robot: Robot) -> Robot:
    """Return the robot without the poses of measuring devices."""
    for session in (None, *robot.session_effects):
        effects = {name: dict(v) for name, v in effects_in(robot, session).items()}
        for name in BASE:
            effects.get("registration", {}).pop(name, None)
        robot = with_effects_in(robot, session, effects)
    return robot


def _noise(commands: Campaign) -> NDArray:
    """Return the standard deviations of the noise, (R, 6) [rad, m]."""
    record = commands.robot.diagnosis
    known = [record.get("noise_rotation"), record.get("noise_position")]
    sizes = [x if isinstance(x, float) else np.nan for x in known]
    more = record.get("normalised")
    factor = max(1.0, more) if isinstance(more, float) else 1.0
    stated = np.where(np.isfinite(commands.sigma), commands.sigma, np.repeat(sizes, 3))
    return np.asarray(factor * stated)


def reading_names(commands: Campaign) -> list[tuple[str, str, int]]:
    """Return the column name, point and component of each reading in a table.

    Args:
        commands: the rows of the table.  Components without a measurement are omitted,
            unless the table contains no measurements.
    """
    points = [""]
    if commands.point is not None:
        points = list(dict.fromkeys(commands.point.tolist()))
    names = []
    for point in points:
        rows = np.ones(len(commands), dtype=bool)
        if commands.point is not None:
            rows = commands.point == point
        taken = commands.cells[rows].any(axis=0)
        if not commands.cells.any():
            taken = np.array([not point] * 3 + [True] * 3)
        at = f"meas.{point}" if point else "meas"
        names += [
            (f"{at}.{READING[k]}", point, k) for k in np.flatnonzero(taken).tolist()
        ]
    return names


def reading_table(predicted: PredictedReadings) -> str:
    """Return predicted readings as a table with the columns of a campaign.

    Args:
        predicted: result of :func:`predict`.

    Returns:
        CSV with empty cells in rows without a solution.  If the robot file contains
        uncertainties, each reading has columns ``std.`` and ``noise.``.  The column
        ``extrapolated`` contains the variables outside the range in which the robot was
        identified.
    """
    commands, deviations = predicted.commands, predicted.prediction.deviation
    columns = reading_names(commands)
    more = {"std": predicted.spread, "noise": predicted.noise}
    more = {k: v for k, v in more.items() if predicted.spread.any()}
    values: dict[str, dict[str, object]] = {}
    for i, label in enumerate(commands.labels):
        point = "" if commands.point is None else str(commands.point[i])
        row = values.setdefault(label, {})
        for name, at, k in columns:
            if at == point:
                row[name] = float(deviations[i, k])
                for kind, array in more.items():
                    row[name.replace("meas", kind, 1)] = float(array[i, k])
        if commands.robot.learned_range:
            row["extrapolated"] = predicted.extrapolated[i]
    names = [name for name, _, _ in columns]
    names += [name.replace("meas", kind, 1) for kind in more for name in names]
    if commands.robot.learned_range:
        names.append("extrapolated")
    return csv_text(values, names)


def csv_text(rows: Mapping[str, Mapping[str, object]], columns: Sequence[str]) -> str:
    """Return a table with labelled rows as CSV.

    Args:
        rows: mapping from row label to row; each row is a mapping from column name to
            value.
        columns: names of the columns after the column ``id``, in order.

    Returns:
        CSV with a header; missing values and NaN are empty cells.
    """
    lines = [",".join(["id", *columns])]
    for label, cells in rows.items():
        lines.append(",".join([label, *(_cell(cells.get(c, "")) for c in columns)]))
    return "\n".join(lines) + "\n"


def _cell(value: object) -> str:
    """Format a number with ten digits; return a text unchanged."""
    if not isinstance(value, float):
        return str(value)
    return "" if np.isnan(value) else f"{value:.10g}"
