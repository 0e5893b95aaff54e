"""Log messages of forcefit, which are shown only on request."""

import logging
import subprocess
import sys

import pytest

import forcefit as ff
from forcefit.assembly.files import solved_links
from forcefit.assembly.files.solved_links import solved_link
from forcefit.assembly.linear.energy import solve_assembly
from tests.assembly.exchange.test_sdf import four_bar
from tests.assembly.files.test_stored_solutions import frame, solved_once, surface
from tests.assembly.linear.test_method import beams, rigid

__all__ = ["solved_once", "surface"]  # fixtures

SCRIPT = """
import sys, forcefit as ff
if sys.argv[2:]:
    import logging
    logging.basicConfig(level=logging.INFO)
ff.load_robot(sys.argv[1])
"""


@pytest.mark.parametrize("wanted", [[], ["log"]])
def test_log_messages_are_printed_only_on_request(wanted, tmp_path):
    (tmp_path / "bar.sdf").write_text(four_bar())
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, tmp_path / "bar.sdf", *wanted],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert done.stdout == ""
    name = ff.load_robot(tmp_path / "bar.sdf").name
    line = f"INFO:forcefit.load:{name}: bar.sdf: taken: mass of links, no inertial"
    assert line in done.stderr if wanted else not done.stderr


def test_fallback_to_the_reference_method_is_logged(caplog):
    caplog.set_level(logging.INFO, "forcefit")
    solve_assembly(beams())
    assert caplog.messages == []
    solve_assembly(rigid())
    solve_assembly([rigid()] * 3)
    name = rigid().robot.name
    assert [message.split(" by the ")[0] for message in caplog.messages] == [
        f"{name}: minimum energy of 1 of 1 points",
        f"{name}: minimum energy of 3 of 3 points",
    ]


def test_requested_reference_method_is_not_logged(caplog):
    caplog.set_level(logging.INFO, "forcefit")
    solve_assembly(rigid(), method="reference")
    solve_assembly([rigid()], method="reference")
    ff.zone_margin(rigid(), method="reference")
    assert caplog.messages == []


def test_reuse_of_a_solved_link_is_logged(solved_once, surface, caplog, monkeypatch):
    """The first link is read from the disk, and the second is known in the process."""
    folder, _ = solved_once
    monkeypatch.setenv("FORCEFIT_CACHE", str(folder))
    monkeypatch.setattr(solved_links, "_SOLVED", {})
    caplog.set_level(logging.INFO, "forcefit")
    solved_link(frame(surface))
    solved_link(frame(surface))
    first, second = caplog.messages
    assert first.startswith(f"finite elements of a link: stored in {folder}")
    assert second == f"link of {surface}: known in this process"
