"""Whatever is done to a campaign's files: it is read, or one line says why not."""

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from stiffness.reading import BadInput
from tests.campaigns_for_tests import HEAD, NOISE, ROWS, write_campaign
from validation.campaign.campaign_file import read_campaign

LIGHT = settings(
    max_examples=300,
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
    ]),
    st.floats().map(repr),
    st.text(max_size=12),
)  # fmt: skip
PIECES = st.sampled_from([
    b"", b"\x00", b"\xff", b"\r", b'"', b",", b";", b"\n", b"\n\n", b"9", b"-", b"e",
    b"\xef\xbb\xbf", b"id,", b",,", b"\t", b"\xe2\x80\xa8",
])  # fmt: skip
TOML = (
    'robot = "robot.toml"\nmeasurements = "measurements.csv"\n'
    'reference_point = [0, 0, 0]\nregistration = "known"\n'
    f'{NOISE}[table]\ndelimiter = ","\n[units]\nposition = "m"\n'
)


def assert_read_or_says_why(folder):
    """The only way out is one line that names a file of the campaign."""
    try:
        campaign = read_campaign(folder)
    except BadInput as error:
        text = str(error)
        assert text.startswith(str(folder))
        assert all(c >= " " for c in text)
        assert len(text) <= 800
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
def test_a_table_with_odd_cells_is_read_or_one_line_says_why(
    changes, registration, tmp_path
):
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
    """The bytes of a file, some of them removed, repeated or replaced."""
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


@LIGHT
@given(content=garbled(TEXT))
def test_a_table_of_garbled_bytes_is_read_or_one_line_says_why(content, tmp_path):
    folder = write_campaign(tmp_path)
    (folder / "measurements.csv").write_bytes(content)
    assert_read_or_says_why(folder)


@LIGHT
@given(content=garbled(TOML))
def test_a_campaign_file_of_garbled_bytes_is_read_or_one_line_says_why(
    content, tmp_path
):
    folder = write_campaign(tmp_path)
    (folder / "campaign.toml").write_bytes(content)
    assert_read_or_says_why(folder)


@settings(LIGHT, max_examples=100)
@given(rows=st.lists(st.lists(st.floats(-1e3, 1e3), min_size=10, max_size=10)))
def test_any_numbers_are_read_or_one_line_says_why(rows, tmp_path):
    lines = [",".join([f"r{i}", *map(repr, row)]) for i, row in enumerate(rows)]
    assert_read_or_says_why(write_campaign(tmp_path, HEAD, lines))


def test_the_campaign_that_is_mangled_is_sound(tmp_path):
    """Otherwise every mutation would stop at the same first mistake."""
    folder = write_campaign(tmp_path)
    (folder / "campaign.toml").write_text(TOML)
    assert len(read_campaign(folder)) == 4
