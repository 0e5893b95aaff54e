"""Create the report section on platform stiffness."""

from typing import Any

import numpy as np

from forcefit.assembly.report.platform_stiffness import (
    DIRECTIONS,
    largest_rows,
    share_rows,
)
from forcefit.assembly.report.share_pictures import share_chart
from forcefit.page.page import paragraph, section
from forcefit.page.tables import table
from forcefit.stiffness.report.link_page import matrix_table
from forcefit.stiffness.screws import WRENCH


def platform_section(stiffness: dict[str, Any]) -> str:
    """Return the section with K_C at the study's pose and the most compliant parts.

    Args:
        stiffness: result of
            :func:`forcefit.assembly.report.platform_stiffness.stiffness_of`.

    Returns:
        HTML with tables and a chart of the contributions to the compliance.
    """
    K = np.asarray(stiffness["stiffness"])
    eigen = ", ".join(f"{one['stiffness']:.4g}" for one in stiffness["eigen"])
    free = len(stiffness["free_motions"])
    shares = list(largest_rows(share_rows(stiffness["shares"])).items())
    blame = [
        [name, *(f"{100 * v:.3g}" if np.isfinite(v) else "-" for v in row)]
        for name, row in shares
    ]
    return section(
        "Stiffness of the platform K_C",
        paragraph(
            "K_C of the nominal robot with its clearances held at zero, at the "
            "platform's origin in base axes [N m/rad, N/rad, N m/m, N/m]"
            + (f"; {free} free motions." if free else ".")
        ),
        matrix_table(K, WRENCH, "platform stiffness"),
        paragraph(
            "Eigen-stiffnesses [N/m], angles times "
            f"{stiffness['characteristic_length']:.4g} m: {eigen}."
        ),
        paragraph(
            "Contributions of the parts to the compliance along each axis [%], largest "
            "first."
        ),
        table(["part", *DIRECTIONS], blame),
        share_chart(stiffness["shares"], "Contribution of each part in the table."),
    )
