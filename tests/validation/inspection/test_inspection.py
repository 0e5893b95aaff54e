"""Test the remarks of an inspection for designs with a known weakness."""

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from forcefit.validation.campaign.campaign_file import read_campaign
from forcefit.validation.inspection.design_remarks import remarks_on
from forcefit.validation.inspection.design_signatures import design_signatures
from forcefit.validation.inspection.inspection import inspect_campaign
from forcefit.validation.inspection.measuring_order import revisits
from forcefit.validation.inspection.repeats import repeat_noise
from tests.campaigns_for_tests import ARM, campaign_of, table_rows, write_campaign

BEAM = "link = { beam = { radius = 0.03 }, young = 7e10, poisson = 0.3 }\n"
ELASTIC = ARM.replace(
    "translation = [1.0, 0, 0]\n", f"translation = [1.0, 0, 0]\n{BEAM}"
)
ELASTIC = ELASTIC.replace("[0.8, 0, 0]\n", f"[0.8, 0, 0]\n{BEAM}")
CELLS = ("rx", "ry", "rz", "tx", "ty", "tz")
HEAD = ",".join([
    "id", "q.one", "q.two", "load.fy", "load.fz", *(f"meas.{c}" for c in CELLS),
    "cov.temperature", "cov.time", "cov.approach",
])  # fmt: skip


def elastic_campaign(folder, rng, temperature=None, heat=0.0, device=None, **more):
    """Return a campaign of an elastic arm with repeats under two loads.

    The temperature [K] varies if it is None.  ``heat`` [1/K] is the thermal expansion
    of both arms, and ``device`` is the rotation and the position of the device.
    """
    q = rng.uniform(-1, 1, (12, 2)) + [0.0, 1.2]
    lines = []
    for i, kind in enumerate(np.concatenate([rng.permutation(24) for _ in range(2)])):
        one, two = q[kind // 2]
        load = (0, 0) if kind % 2 else (30, -20)
        tool = np.array([np.cos(one), np.sin(one), 0.0])
        tool += 0.8 * np.array([np.cos(one + two), np.sin(one + two), 0.0])
        T = 3 * np.sin(i / 5) if temperature is None else temperature
        turn, shift = np.zeros(3), heat * T * tool
        if device is not None:
            turn = device[0].as_rotvec()
            shift = device[0].apply(tool + shift) + device[1] - tool
        reading = np.concatenate([turn, shift])
        reading += rng.normal(size=6) * ([1e-5] * 3 + [5e-6] * 3)
        lines.append([one, two, *load, *reading, T, 60 * i, 1 - 2 * (i % 2)])
    rows = table_rows(lines)
    return read_campaign(write_campaign(folder, HEAD, rows, robot=ELASTIC, **more))


def test_inspection_table_has_a_row_for_each_effect(tmp_path):
    """A length error of 0.1 mm is 20 sigma in 48 rows, for each of two links."""
    pytest.importorskip("xarray")
    found = inspect_campaign(elastic_campaign(tmp_path, np.random.default_rng(1)))
    table = found.to_pandas()
    assert sorted(table.index) == sorted(found.table()["effects"])
    length = table.loc["link_length"]
    assert length["strength", ""] == pytest.approx(20 * np.sqrt(48 * 2), rel=1e-6)
    assert length["rank", ""] == 2
    assert not table.loc["body_mass", ("testable", "")]
    assert "gravity" in table.loc["body_mass", ("reason", "")]


def texts(campaign):
    """Return all remarks about the design of a campaign."""
    repeats = revisits(campaign, campaign.repeat)
    visits = revisits(campaign, campaign.configuration)
    noise = repeat_noise(campaign)
    found = remarks_on(campaign, repeats, visits, noise)
    return [f"{r.about} {r.weight}: {r.text}" for r in found]


def sound(rng, **changes):
    """Return a campaign without weaknesses, except for the given changes."""
    rows = 60
    kinds = np.concatenate([rng.permutation(20) for _ in range(3)])
    loads = np.zeros((rows, 6))
    loads[:, 3:] = rng.integers(-2, 3, (20, 3))[kinds] * 10
    given = {
        "measured": rng.normal(size=(rows, 6)) * 1e-5,
        "sigma": 1e-5,
        "repeat": kinds,
        "loads": loads,
        "time": np.arange(rows) * 60.0,
        "temperature": rng.uniform(-3, 3, rows),
        "approach": rng.permutation(np.tile([-1.0, 1.0], 30)),
    } | changes
    return campaign_of(**{k: v for k, v in given.items() if v is not None})


STILL, NOISE = np.zeros((60, 6)), np.random.default_rng(4).normal(size=(60, 6))
ALWAYS = np.tile([0, 0, 0, 0, 0, -50.0], (60, 1))
SAYINGS = {
    "no load": ({"loads": STILL}, "load lost: No load was applied"),
    "one load": ({"loads": ALWAYS}, "load lost: All rows have the same load"),
    "no thermometer": ({"temperature": None},
        "temperature lost: The campaign has no cov.temperature"),
    "constant": ({"temperature": np.full(60, 6.0)},
        "temperature lost: The temperature is +6 K in every row, so thermal "
        "expansion has the same effect as longer links."),
    "calibrated": ({"temperature": np.zeros(60)},
        "is +0 K in every row, so thermal expansion has no effect."),
    "too even": ({"temperature": np.linspace(0, 0.1, 60)},
        "temperature careful: The temperature varied by 0.1 K. Thermal expansion of "
        "aluminium would move the platform by at most 2.4e-06 m, less than one sigma."),
    "no side": ({"approach": None}, "approach lost: The campaign has no cov.approach"),
    "one side": ({"approach": np.ones(60)}, "approach lost: All rows were approached"),
    "no clock": ({"time": None}, "time lost: The campaign has no cov.time"),
    "never rotations": ({"measured": np.c_[np.full((60, 3), np.nan), STILL[:, :3]]},
        "readings lost: Components never measured: rx, ry, rz."),
    "stuck": ({"measured": STILL}, "readings careful: rx is the same in every row"),
    "nothing twice": ({"repeat": np.arange(60)}, "repeats lost: There are no repeated"),
    "in a row": ({"repeat": np.repeat(np.arange(20), 3)},
        "repeats careful: Repeats were measured consecutively"),
    "in one go": ({"repeat": np.repeat(np.arange(20), 3)},
        "configurations lost: All rows of each configuration were measured"),
    "one configuration": ({"repeat": np.zeros(60, dtype=int)},
        "configurations lost: There is only one configuration"),
    "few repeats": ({"repeat": np.r_[np.arange(58), 0, 1]},
        "repeats careful: There are few repeats (12 degrees of freedom)."),
    "noisy": ({"measured": 2e-5 * NOISE}, "careful: The scatter of repeats is "),
    "quiet": ({"measured": 5e-6 * NOISE}, "The scatter of repeats is only 0."),
    "rounded": ({"measured": np.round(NOISE, 1) * 1e-3},
        "is rounded to 0.0001, more than twice its sigma 1e-05"),
    # The deviations are about 30 mm for a robot of 1 m.
    "implausible size": ({"measured": 0.03 * NOISE}, "Is the unit m, and is"),
    "correlated": ({"temperature": np.arange(60) / 10 + NOISE[:, 0] / 10},
        "time and temperature vary together (correlation +1.00)"),
}  # fmt: skip


@pytest.mark.parametrize("case", SAYINGS)
def test_weakness_of_a_design_is_reported(case, rng):
    changes, sentence = SAYINGS[case]
    assert any(sentence in text for text in texts(sound(rng, **changes)))


def test_good_design_has_a_single_remark(rng):
    """The remark is that each configuration has only one load."""
    found = [t for t in texts(sound(rng)) if " fine: " not in t]
    assert found == [
        "load careful: No configuration was measured under two loads, so only the "
        "model distinguishes effects of the load from effects of the configuration."
    ]


def test_consecutive_outliers_are_reported_as_a_sudden_change(rng):
    """Six outliers of 30 sigma are consecutive or spread over the session."""
    for rows, sentence in (
        (range(10, 16), "suspects careful: Readings that differ strongly"),
        (range(3, 60, 10), None),
    ):
        measured = rng.normal(size=(60, 6)) * 1e-5
        measured[list(rows), 4] += 3e-4 * rng.choice([1, -1], 6)
        found = [t for t in texts(sound(rng, measured=measured)) if "suspects" in t]
        assert [t.startswith(sentence or "?") for t in found] == [True] * bool(sentence)


def test_expansion_and_length_are_equivalent_at_constant_temperature(tmp_path, rng):
    """They are distinguished by a varying temperature."""
    constant = inspect_campaign(elastic_campaign(tmp_path / "a", rng, temperature=6.0))
    alike = ("thermal_expansion", "delayed_expansion", "link_length")
    assert alike in constant.separability.classes()
    varied = inspect_campaign(elastic_campaign(tmp_path / "b", rng))
    assert not any("thermal_expansion" in c for c in varied.separability.classes())
    at_calibration = inspect_campaign(
        elastic_campaign(tmp_path / "c", rng, temperature=0.0)
    )
    why = at_calibration.signatures.untestable["thermal_expansion"]
    assert why == "requires cov.temperature, not 0 in all rows"


def test_first_encoder_offset_is_equivalent_to_a_device_rotation(tmp_path, rng):
    """Both are rotations about the z axis of the base."""
    known = inspect_campaign(elastic_campaign(tmp_path / "a", rng)).separability
    i = known.names.index("encoder_offset")
    assert known.rank[i] == 2
    unknown = inspect_campaign(
        elastic_campaign(tmp_path / "b", rng, toml={"registration": '"unknown"'})
    ).separability
    assert unknown.rank[i] == 1
    assert unknown.names == known.names
    assert 0 < unknown.left[i] < 0.9 < known.left[i]


def test_undetermined_device_pose_is_reported(tmp_path):
    """In both rows, only one angle is measured."""
    rows = ["a,0.1,0.2,1e-5", "b,0.1,0.2,2e-5"]
    folder = write_campaign(tmp_path, "id,q.one,q.two,meas.rz", rows,
                            toml={"registration": '"unknown"'})  # fmt: skip
    first = inspect_campaign(read_campaign(folder)).remarks[0]
    assert (first.about, first.weight) == ("registration", "lost")
    assert "The registration cannot be found." in first.text


def test_signature_of_encoder_offset_agrees_with_hand_calculation(tmp_path, rng):
    """The offset of the second joint rotates the tool about the elbow."""
    campaign = elastic_campaign(tmp_path, rng)
    found = design_signatures(campaign).columns["encoder_offset"]
    elbow, tool = (campaign.transforms[:, campaign.robot.index(n), :3, 3]
                   for n in ("two", "tool"))  # fmt: skip
    arm = tool - elbow
    by_hand = np.zeros((len(campaign), 6))
    by_hand[:, 2] = 1.0
    by_hand[:, 3], by_hand[:, 4] = -arm[:, 1], arm[:, 0]
    whitened = (by_hand / campaign.sigma).reshape(-1)
    column = found[:, 1]
    np.testing.assert_allclose(
        column / np.linalg.norm(column), whitened / np.linalg.norm(whitened), atol=2e-4
    )


@pytest.mark.parametrize("registration", ["known", "unknown"])
def test_noise_estimate_does_not_include_expansion(registration, tmp_path, rng):
    """The expansion is 12 sigma, and the pose of the device may be unknown."""
    device = None
    if registration == "unknown":
        device = Rotation.from_rotvec([0.5, -1.2, 1.5]), np.array([3.0, -4.0, 1.0])
    toml = {"registration": f'"{registration}"'}
    campaign = elastic_campaign(tmp_path, rng, heat=2e-5, device=device, toml=toml)
    noise = inspect_campaign(campaign).noise
    assert noise.plain > 3
    assert 0.8 < noise.ratio < 1.2
    assert noise.taken_out["temperature"] < 1e-9


def test_inspect_command_writes_all_sections(tmp_path, rng, run):
    elastic_campaign(tmp_path / "arm", rng, temperature=6.0)
    status, out, _ = run("validation", "inspect", tmp_path / "arm", "--json", "-")
    assert status == 0
    found = json.loads(out)
    assert found["rows"] == 48
    assert found["configurations"]["count"] == 12
    assert found["configurations"]["order"] == "interleaved"
    assert found["loads"]["levels"] == 2
    assert found["loads"]["configurations_under_several"] == 12
    assert found["repeats"] | {"span": 0} == {
        "sets": 24, "rows": 48, "others": 0, "span": 0, "order": "interleaved",
        "adjacent": found["repeats"]["adjacent"],
    }  # fmt: skip
    low, high = found["noise"]["interval"]
    assert low < found["noise"]["ratio"] < high
    assert ["thermal_expansion", "delayed_expansion", "link_length"] in found[
        "inseparable"
    ]
    assert found["effects"]["geometric_stiffening"]["testable"] is False
    assert len(found["cosines"]["shared"]) == len(found["cosines"]["effects"])
    status, out, _ = run("validation", "inspect", tmp_path / "arm")
    assert status == 0
    alike = "thermal_expansion, delayed_expansion, link_length"
    assert f"cannot be distinguished: {alike}" in out
    assert "This campaign cannot determine:" in out


def test_dh_parameters_without_alpha_cause_a_remark(tmp_path):
    flat = ARM.replace("translation = [1.0, 0, 0]\n", "dh = { a = 1.0 }\n")
    assert flat != ARM
    campaign = read_campaign(write_campaign(tmp_path / "campaign", robot=flat))
    found = [r for r in inspect_campaign(campaign).remarks if r.about == "robot"]
    assert [r.text for r in found] == ['dh without alpha, which is set to 0: "two"']
