"""Products of candidates row by row, against their columns multiplied out."""

from dataclasses import replace

import numpy as np
import pytest

from assembly.files.robot_file import read_robot
from tests.campaigns_for_tests import ARM
from validation.campaign.campaign_file import read_commands
from validation.diagnosis.blocks import Blocks
from validation.diagnosis.candidates import Candidate, CandidatePart, Sensitivities
from validation.diagnosis.forms_tried import REVERSAL, CandidateShape
from validation.diagnosis.remainder import in_cells
from validation.diagnosis.responses import responses
from validation.diagnosis.signatures import conditions_of

ORDERS = [1], [2, 3], [1, 2, 3, 4], [3]
WAVES = [
    CandidateShape(
        "waves", tuple(f"{k}.{w}" for k in orders for w in ("sine", "cosine"))
    )
    for orders in ORDERS
]
SHAPES = [*WAVES, CandidateShape("powers", ("0", "1", "2")), REVERSAL]
PLACES = [
    ("screw", (CandidatePart("one", ("rz",), "q.one"),)),
    ("screw", (CandidatePart("two", ("rx", "ry", "rz"), "q.one"),)),
    ("compliance", (CandidatePart("two", ("rz",), "q.two"),)),
    ("screw", (CandidatePart("base", ("tx", "ty", "tz"), "q.two"),)),
    ("screw", (CandidatePart("reading", ("ty",), "q.two"),)),
    ("screw", tuple(CandidatePart(w, ("rz",), f"q.{w}") for w in ("one", "two"))),
]


@pytest.fixture(params=[False, True], ids=["all measured", "gaps"])
def measured(request, tmp_path, rng):
    """Thirty commands of the planar arm, sigmas unlike, a loaded tool."""
    lines = [f"m{i},{a:.4f},{b:.4f},7" for i, (a, b) in enumerate(rng.random((30, 2)))]
    table = tmp_path / "commands.csv"
    table.write_text("\n".join(["id,q.one,q.two,load.fy", *lines]) + "\n")
    (tmp_path / "arm.toml").write_text(ARM)
    campaign = read_commands(table, read_robot(tmp_path / "arm.toml"))
    readings = rng.normal(size=(30, 6))
    if request.param:
        readings[rng.random((30, 6)) < 0.3] = np.nan
    sigma = rng.uniform(0.5, 2, (30, 6))
    campaign = replace(campaign, measured=readings, sigma=sigma)
    conditions = conditions_of(campaign)
    s = Sensitivities(conditions, campaign.robot, responses(conditions))
    return campaign, s


def test_products_are_those_of_the_columns(measured, rng):
    campaign, s = measured
    count = int(campaign.cells.sum())
    Y = np.linalg.qr(rng.normal(size=(count, 5)))[0]
    left = rng.normal(size=count)
    blocks = Blocks(campaign, s, (Y[:, :2], Y[:, 2:]), left)
    candidates = [Candidate(parts, kind, shape) for shape in SHAPES
                  for kind, parts in PLACES]  # fmt: skip
    found = dict(blocks.of(candidates))
    assert sorted(found) == list(range(len(candidates)))
    for k, one in enumerate(candidates):
        B = in_cells(s, one, campaign)
        scale = np.linalg.norm(B, axis=0).max()
        free = B - Y @ (Y.T @ B)
        np.testing.assert_allclose(
            found[k].gram, B.T @ free, rtol=0, atol=1e-12 * scale**2
        )
        np.testing.assert_allclose(
            found[k].along, B.T @ left, rtol=0, atol=1e-12 * scale * np.sqrt(count)
        )
        assert found[k].size == pytest.approx(scale)


def test_some_rows_alone(measured, rng):
    """Of sensitivities taken of some rows, in another order than candidates are."""
    campaign, s = measured
    rows = np.arange(3, 21)
    some, part = campaign.take(rows), s.take(rows)
    none = np.zeros((int(some.cells.sum()), 0))
    left = rng.normal(size=len(none))
    candidates = [Candidate(PLACES[1][1], "screw", shape) for shape in SHAPES[::-1]]
    for k, block in Blocks(some, part, (none,), left).of(candidates):
        B = in_cells(part, candidates[k], some)
        scale = np.linalg.norm(B)
        np.testing.assert_allclose(block.gram, B.T @ B, rtol=0, atol=1e-12 * scale**2)
