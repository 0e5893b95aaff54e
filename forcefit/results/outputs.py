"""Records for the JSON output of all commands."""

from collections.abc import Mapping

from forcefit.results.of_assembly import ASSEMBLY
from forcefit.results.of_measurement import MEASUREMENT
from forcefit.results.of_stiffness import STIFFNESS
from forcefit.results.of_validation import VALIDATION
from forcefit.results.records import Content

OUTPUTS: Mapping[str, Content] = {
    **ASSEMBLY,
    **STIFFNESS,
    **MEASUREMENT,
    **VALIDATION,
}
