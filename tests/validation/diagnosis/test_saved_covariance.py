"""Test the reading of damaged covariance files."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit.assembly.robots import load_robot
from forcefit.inputs.errors import BadInput
from forcefit.validation.diagnosis.saved_covariance import (
    SavedCovariance,
    read_covariance,
    write_covariance,
)


def cut_to(share):
    return lambda content: content[: int(share * len(content))]


@pytest.mark.parametrize(
    "damage",
    [cut_to(0.0), cut_to(0.3), cut_to(0.9), lambda content: b"[" * 100_000,
     lambda content: content.replace(b"\x08\x00", b"\x63\x00")],
    ids=["empty", "third", "end", "text", "compression"],
)  # fmt: skip
def test_damaged_covariance_file_is_rejected(tmp_path, damage):
    path = tmp_path / "saved.npz"
    write_covariance(SavedCovariance((), np.zeros((0, 0))), path)
    robot = replace(load_robot("arm6"), diagnosis={"covariance": str(path)})
    assert read_covariance(robot).covariance.shape == (0, 0)
    path.write_bytes(damage(path.read_bytes()))
    with pytest.raises(BadInput, match=r"saved\.npz: found damaged content, expected"):
        read_covariance(robot)
