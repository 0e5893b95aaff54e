"""ROS bags, written by ``rosbags`` itself; skipped without it."""

import json

import numpy as np
import pytest

from forcefit.inputs.errors import BadInput
from forcefit.validation.campaign.campaign_file import read_campaign
from forcefit.validation.exchange.bag import is_bag, read_bag
from tests.validation.exchange.test_tracker import (
    ANGLES,
    SHIFT,
    TARGETS,
    TURN,
    Lab,
    seen,
)

START = 1_700_000_000  # [s] of the first command


def write_bag(path, plugin, transforms):
    """Write a rosbag2 of readings of the planar arm, a second after commands."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.LATEST)
    types = store.types
    Time, Header = types["builtin_interfaces/msg/Time"], types["std_msgs/msg/Header"]
    kind = "tf2_msgs/msg/TFMessage" if transforms else "geometry_msgs/msg/PointStamped"
    with Writer(path, version=9, storage_plugin=StoragePlugin[plugin]) as bag:
        topics = {
            name: bag.add_connection("/tf" if transforms else f"/lab/{name}", kind,
                                     typestore=store)
            for name in (["tf"] if transforms else TARGETS)
        }  # fmt: skip
        for k, angles in enumerate(ANGLES):
            stamp = Time(sec=START + 60 * k + 1, nanosec=500_000_000)
            nanoseconds = stamp.sec * 10**9 + stamp.nanosec
            header = Header(stamp=stamp, frame_id="tracker")
            places = {name: seen(angles, name) for name in TARGETS}
            if transforms:
                Vector = types["geometry_msgs/msg/Vector3"]
                turn = types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0)
                message = types[kind](transforms=[
                    types["geometry_msgs/msg/TransformStamped"](
                        header=header, child_frame_id=name,
                        transform=types["geometry_msgs/msg/Transform"](
                            translation=Vector(*place.tolist()), rotation=turn),
                    ) for name, place in places.items()
                ])  # fmt: skip
                raw = store.serialize_cdr(message, kind)
                bag.write(topics["tf"], nanoseconds, raw)
                continue
            Point = types["geometry_msgs/msg/Point"]
            for name, place in places.items():
                message = types[kind](header=header, point=Point(*place.tolist()))
                bag.write(topics[name], nanoseconds, store.serialize_cdr(message, kind))


@pytest.mark.parametrize("transforms", [False, True])
@pytest.mark.parametrize("plugin", ["SQLITE3", "MCAP"])
def test_ros_bag_readings_are_assigned_to_commands_by_time(
    tmp_path, run, plugin, transforms
):
    """Bags contain double precision, so deviations are round-off."""
    pytest.importorskip("rosbags")
    lab = Lab(tmp_path)
    lab.commands([START + 60 * k for k in range(len(ANGLES))])
    write_bag(tmp_path / "bag", plugin, transforms)
    assert is_bag(tmp_path / "bag")
    status, out, err = run(*lab.words("bag"), "--json", "-")
    assert status == 0, err
    table = json.loads(out)
    assert (table["joined_by"], table["rows"], table["readings"]) == ("time", 13, 39)
    assert table["device"]["rotation"] == pytest.approx(TURN.as_matrix(), abs=1e-12)
    assert table["device"]["shift"] == pytest.approx(SHIFT, abs=1e-12)
    campaign = read_campaign(tmp_path / "campaign")
    assert np.abs(campaign.measured[:, 3:]).max() < 1e-12


def test_damaged_ros_bag_is_rejected(tmp_path):
    pytest.importorskip("rosbags")
    (tmp_path / "metadata.yaml").write_text("rosbag2_bagfile_information: {}\n")
    for path in (tmp_path, tmp_path / "no.bag"):
        with pytest.raises(BadInput, match="not a readable bag") as error:
            read_bag(path)
        assert "\n" not in str(error.value)


def test_ros_bag_without_rosbags_names_the_missing_package(tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "rosbags.highlevel", None)
    with pytest.raises(BadInput, match=r"install forcefit\[ros\], or export"):
        read_bag(tmp_path / "lab.bag")
