"""Define the JSON schema of ``campaign.toml``, which editors can use."""

from forcefit.assembly.effects import LIBRARY
from forcefit.results.quantities import number, text
from forcefit.results.records import Each, Either, Listed, Record, Words, record
from forcefit.validation.campaign.dialect import DELIMITERS, MOTIONS, UNITS

_BY_ROW = tuple(name for name, effect in LIBRARY.items() if effect.by_row)
CAMPAIGN_FILE = record(
    robot=text("built-in robot or robot file"),
    measurements=Either((text("CSV file"), text("CSV file of each session", "file"))),
    reference_point_="reference_point",
    points_=Each(number("point of the platform, its axes", "m", "axis")),
    registration_=Words(("known", "unknown")),
    noise_=record(rotation_=number("standard deviation of a rotation", "rad"),
                  position_=number("standard deviation of a position", "m")),
    per_session_=Listed(Words(_BY_ROW)),
    table_=record(delimiter_=Words((*DELIMITERS,)), decimal_=Words((".", ","))),
    units_=Record(
        {key: Words((*names,)) for key, names in UNITS.items()}
        | {"cov": Each(Words((*MOTIONS,)))},
        frozenset((*UNITS, "cov")),
    ),
)  # fmt: skip
