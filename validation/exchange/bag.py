"""Read points, poses and transforms from ROS bags, using the package ``rosbags``.

A bag is a rosbag2 folder (SQLite or MCAP) or a ROS 1 ``.bag`` file.  The name of a
reading consists of its topic and frame, and its time is the time stamp of the message.
Lengths are in metres.
"""

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from forcefit.inputs.errors import BadInput, one_line
from forcefit.inputs.packages import naming_packages
from forcefit.validation.exchange.orientation import from_quaternion
from forcefit.validation.exchange.reading import LARGEST, Reading

_MESSAGES = {
    "geometry_msgs/msg/PointStamped", "geometry_msgs/msg/PoseStamped",
    "geometry_msgs/msg/TransformStamped", "tf2_msgs/msg/TFMessage",
}  # fmt: skip


def is_bag(path: Path | str) -> bool:
    """Return whether a path is a ``.bag`` file or a folder with ``metadata.yaml``."""
    path = Path(path)
    return path.suffix.lower() == ".bag" or os.path.isfile(path / "metadata.yaml")


def read_bag(path: Path | str, oriented: bool = False) -> list[Reading]:
    """Return all points, poses and transforms in a bag as readings.

    Args:
        path: a rosbag2 folder or a ROS 1 bag.
        oriented: whether to read orientations.

    Returns:
        The readings, in the order of the recording.

    Raises:
        BadInput: ``rosbags`` is not installed, the bag cannot be read, or it contains
            no points, poses or transforms.
    """
    with naming_packages(f"{path}: a bag", "export its points as a table"):
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore

    readings = []
    try:
        store = get_typestore(Stores.LATEST)
        with AnyReader([Path(path)], default_typestore=store) as bag:
            wanted = [c for c in bag.connections if c.msgtype in _MESSAGES]
            for number, (link, _, raw) in enumerate(bag.messages(wanted), 1):
                message = bag.deserialize(raw, link.msgtype)
                topic = [part for part in link.topic.split("/") if part]
                for frame, header, place, turn in _places(message):
                    names = tuple(dict.fromkeys([*topic, frame]))
                    turn = turn if oriented else None
                    readings.append(
                        _reading(str(path), number, names, header, place, turn)
                    )
    except BadInput:
        raise
    except Exception as error:  # the readers of rosbags may raise any exception
        reason = one_line(str(error), 120) or type(error).__name__
        raise BadInput(f"{path}: not a readable bag: {reason}") from None
    if not readings:
        kinds = ", ".join(sorted(name.rpartition("/")[2] for name in _MESSAGES))
        raise BadInput(f"{path}: found no messages of points, expected {kinds}")
    return readings


def _places(message: Any) -> Iterator[tuple[str, Any, Any, Any]]:
    """Yield the frame, header, position and quaternion (or None) of each point."""
    for one in getattr(message, "transforms", [message]):
        if hasattr(one, "transform"):
            T = one.transform
            yield one.child_frame_id, one.header, T.translation, T.rotation
        elif hasattr(one, "pose"):
            frame, pose = one.header.frame_id, one.pose
            yield frame, one.header, pose.position, pose.orientation
        else:
            yield one.header.frame_id, one.header, one.point, None


def _reading(
    path: str, number: int, names: tuple[str, ...], header: Any, place: Any, turn: Any
) -> Reading:
    """Return a reading of a bag, whose ``line`` is the index of the message."""
    position = np.array([place.x, place.y, place.z], dtype=float)
    if np.isnan(position).any():
        position[:] = np.nan  # the device did not detect the target
    elif not (np.abs(position) <= LARGEST).all():
        raise BadInput(
            f"{path}: message {number}: found {position.tolist()}, "
            "expected a position [m]"
        )
    time = header.stamp.sec + 1e-9 * header.stamp.nanosec
    rotation, where = None, f"{path}: message {number}"
    if turn is not None and any((turn.w, turn.x, turn.y, turn.z)):
        rotation = from_quaternion(where, [turn.w, turn.x, turn.y, turn.z])
    return Reading(path, number, names, position, np.full(3, np.nan), time, rotation)
