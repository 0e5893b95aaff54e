"""Test that damaged campaign files are read or rejected with one line of text.

Each test uses 100 or 200 random cases.  The script ``benchmarks/fuzz.py`` tests more
cases.
"""

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from forcefit.inputs.table import BadInput
from forcefit.validation.campaign.campaign_file import read_campaign
from tests.campaigns_for_tests import HEAD, NOISE, ROWS, write_campaign

LIGHT = settings(
    max_examples=100,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
TEXT = "\n".join([HEAD, *ROWS, ""])
ODD_CELLS = st.one_of(
    st.sampled_from([
        "", " ", "nan", "inf", "-inf", "1e400", "1e-400", "1e99999", "-0", "0", "1",
        "-1", "1_0", "1,5", "1.5", "1..5", "1e", "+", ".", "0x10", "1e15", "1e16",
        "1e308", "5e-324", "9" * 500, "x" * 5000, '"', '""', '"a""b"', "a\nb", "\r",
        "\x00", "\u2028", "١", "−1", "id", "m1", "q.one", "meas.tx", "cov.", "cov.x",
        "sigma.tx", "pose.tx", "load.fz", "cov.time", "q.", "meas.", "q.tool",
        '"0,001"', '"1,5"', '"1.000,5"', "1.000.000", "\ufeffid", "\ufeff", "\x00id",
        "m1\x00", "\x1a", "\x7f", "$x$", "<b>", "1e15" * 9, "-" + "9" * 400,
        "0." + "0" * 400 + "1", "9e9999", "1e15,1e15", '"m1', "\u00a0", "1\u00a0000",
    ]),
    st.floats().map(repr),
    st.text(max_size=12),
)  # fmt: skip
PIECES = st.sampled_from([
    b"", b"\x00", b"\xff", b"\r", b'"', b",", b";", b"\n", b"\n\n", b"9", b"-", b"e",
    b"\xef\xbb\xbf", b"id,", b",,", b"\t", b"\xe2\x80\xa8", b"\r\n", b"\x00" * 64,
    b"\xff\xfei\x00d\x00", b"\xe9", b"\xed\xa0\x80", b'"0,5"', b"1e400", b"9" * 400,
    b"\x1a", b"# ", b"id,id,", b"m1,", b"[[", b"]]", b"inf", b"nan", b"-0.0",
])  # fmt: skip
TOML = (
    'robot = "robot.toml"\nmeasurements = "measurements.csv"\n'
    'reference_point = [0, 0, 0]\nregistration = "known"\n'
    f'{NOISE}[table]\ndelimiter = ","\n[units]\nposition = "m"\n'
)


def assert_one_line(error, folder):
    """Check that the message is one line that begins with the path of the folder."""
    text = str(error)
    assert text.startswith(str(folder))
    assert all(c >= " " for c in text)
    assert len(text) <= 800


def assert_read_or_says_why(folder):
    """Check the arrays of a campaign, or the message if it cannot be read."""
    try:
        campaign = read_campaign(folder)
    except BadInput as error:
        assert_one_line(error, folder)
        return
    cells = np.isfinite(campaign.measured)
    assert cells.any(axis=1).all()
    assert (campaign.sigma[cells] > 0).all()
    assert np.isfinite(campaign.transforms).all()
    assert np.isfinite(campaign.loads).all()
    assert len(set(campaign.ids)) == len(campaign)


@LIGHT
@given(
    changes=st.lists(
        st.tuples(st.integers(0, 4), st.integers(0, 10), ODD_CELLS), max_size=3
    ),
    registration=st.sampled_from(["known", "unknown"]),
)
def test_table_with_unusual_cells_is_read_or_rejected(changes, registration, tmp_path):
    table = [line.split(",") for line in TEXT.splitlines()]
    for row, column, cell in changes:
        table[row][column] = cell
    head, *rows = (",".join(row) for row in table)
    folder = write_campaign(
        tmp_path, head, rows, toml={"registration": f'"{registration}"'}
    )
    assert_read_or_says_why(folder)


@st.composite
def garbled(draw, text):
    """Return the bytes of a file, with random bytes removed, repeated or replaced."""
    content = text.encode()
    for _ in range(draw(st.integers(1, 4))):
        start = draw(st.integers(0, max(0, len(content) - 1)))
        stop = start + draw(st.integers(0, 40))
        piece = content[start:stop]
        new = draw(
            PIECES
            | st.just(piece * 2)
            | st.text("0123456789.-e,; \n\"'[]={}#_m", max_size=6).map(str.encode)
        )
        content = content[:start] + new + content[stop:]
    return content


@settings(LIGHT, max_examples=200)
@given(
    file=st.sampled_from([("measurements.csv", TEXT), ("campaign.toml", TOML)]),
    data=st.data(),
)
def test_damaged_campaign_file_is_read_or_rejected(file, data, tmp_path):
    name, text = file
    folder = write_campaign(tmp_path)
    (folder / name).write_bytes(data.draw(garbled(text)))
    assert_read_or_says_why(folder)


def test_undamaged_campaign_is_read(tmp_path):
    """The file that other tests damage is valid."""
    folder = write_campaign(tmp_path)
    (folder / "campaign.toml").write_text(TOML)
    assert len(read_campaign(folder)) == 4
