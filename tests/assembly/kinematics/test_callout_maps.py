"""Datum frames and frame errors, compared with formulas and finite motions."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit.assembly.callouts.callout import Callout, Datum
from forcefit.assembly.kinematics.callout_maps import place_callouts
from forcefit.assembly.kinematics.posture import home_posture, place_robot
from forcefit.assembly.model.robot import Frame, Robot
from forcefit.inputs.table import BadInput
from forcefit.stiffness.screws import rotation_matrix, rotation_vector

TURN = np.pi / 2
# The plate has a face A with normal z, a face B with normal x that is 60 mm long along
# z, and a hole at a distance of 80 mm from B along x.
PLATE = Robot(
    "plate",
    "tip",
    (
        Frame("plate"),
        Frame("A", "plate"),
        Frame("B", "plate", rotation=np.array([0, TURN, 0]), joint="revolute"),
        Frame("hole", "plate", np.array([0.08, 0, 0]), joint="revolute"),
        Frame("tip", "hole", np.array([0.1, 0, 0])),
    ),
)
A, B = Datum("A", "plane"), Datum("B", "plane")
SIDE_FACE = Callout(
    "side face", "B", (A,), shape="plane", extent=(0.06, 0.04),
    widths={"perpendicularity": 0.05e-3},
)  # fmt: skip


def placed(robot, *callouts):
    return place_callouts(home_posture(replace(robot, callouts=callouts)))


def hole(*datums):
    return Callout("hole", "hole", datums, extent=(0.02,), widths={"position": 1e-9})


def with_bore(x, y):
    """Return the plate with an additional bore along z at a point [m]."""
    bore = Frame("bore", "plate", np.array([x, y, 0]))
    return replace(PLATE, frames=(*PLATE.frames, bore))


def test_hole_displacement_depends_on_the_order_of_datums():
    """The hole moves by 66.7 um for datums B|A, and by zero for A|B.

    B is tilted relative to A by 0.05 mm over 60 mm, and the hole is at 80 mm.
    """
    row = PLATE.index("hole")
    largest = []
    for datums in ((A, B), (B, A)):
        face, _ = placed(PLATE, SIDE_FACE, hole(*datums))
        normal = face.errors[row, 5]
        largest.append(face.zone.support(_on_screw(face, normal)))
    assert largest[0] == pytest.approx(0.0, abs=1e-15)
    assert largest[1] == pytest.approx(66.67e-6, rel=1e-3)


def _on_screw(placed_callout, row):
    """Return a vector (6,) whose product with the screw of u equals row @ u."""
    return row @ np.linalg.pinv(placed_callout.zone.columns)


def test_tilt_of_a_face_equals_zone_width_divided_by_length():
    (face,) = placed(PLATE, SIDE_FACE)
    tilt = face.errors[PLATE.index("B"), 1]
    assert face.zone.support(_on_screw(face, tilt)) == pytest.approx(
        0.8333e-3, rel=1e-4
    )


def test_secondary_datum_fixes_remaining_degrees_of_freedom():
    """Plane A fixes RX, RY, TZ.  A bore B along z then fixes TX, TY but not RZ."""
    robot = with_bore(0.0, 0.05)
    bore = Callout("bore", "bore", (A,), extent=(0.02,), widths={"position": 0.1e-3})
    first, _ = placed(robot, bore, hole(A, Datum("bore")))
    moved = first.errors[robot.index("hole")]
    own = first.errors[robot.index("bore")]
    # The shift of the bore moves the hole, its tilt does not.
    assert moved[[3, 4]] == pytest.approx(own[[3, 4]], abs=1e-12)
    assert np.abs(moved[[0, 1, 2, 5]]).max() < 1e-12


def test_shift_of_a_datum_depends_on_its_hole_size():
    """A bore 12 H7 exceeds its minimum size by at most 18 um.

    The datum shifts by up to 9 um, with a standard deviation of 9 um / sqrt 12.
    """
    robot = with_bore(0.0, 0.05)
    shifting = Datum("bore", hole="12 H7", hole_of="bore")
    _, shift = placed(robot, hole(A, shifting))
    moved = shift.errors[robot.index("hole")]
    for row in (3, 4):
        toward = _on_screw(shift, moved[row])
        assert shift.zone.support(toward) == pytest.approx(9e-6, rel=1e-9)
    C = moved @ shift.zone.variance_of_u() @ moved.T
    assert np.sqrt(C[3, 3]) * 1e6 == pytest.approx(9 / np.sqrt(12), rel=1e-9)
    draws = shift.zone.draw(
        lambda attempt: np.random.default_rng(attempt).random((200_000, 3))
    )
    assert (draws @ moved[3]).std() == pytest.approx(np.sqrt(C[3, 3]), rel=0.01)
    assert np.abs(moved[[0, 1, 2, 5]]).max() < 1e-12
    assert shift.name == "shift of datum bore of hole"


def test_shift_of_a_second_bore_rotates_the_datum_frame():
    """Bore B at 50 mm shifts by 9 um, so the hole at 80 mm moves by 14.4 um."""
    robot = with_bore(0.05, 0.0)
    shifting = Datum("bore", hole="12 H7", hole_of="bore")
    _, shift = placed(robot, hole(Datum("A"), shifting))
    moved = shift.errors[robot.index("hole")]
    supports = [shift.zone.support(_on_screw(shift, row)) for row in moved]
    assert supports[4] == pytest.approx(14.4e-6, rel=1e-9)
    assert supports[2] == pytest.approx(9e-6 / 0.05, rel=1e-9)
    assert max(supports[0], supports[1], supports[3], supports[5]) < 1e-12


# crank 0.4 m, rod 0.3 m, bore of the rod at the elbow 20 mm long
SERIAL = Robot(
    "serial",
    "tip",
    (
        Frame("shoulder", joint="revolute", actuated=True, position=0.5),
        Frame("elbow", "shoulder", np.array([0.4, 0, 0]), joint="revolute",
              actuated=True, position=0.7),
        Frame("tip", "elbow", np.array([0.3, 0, 0])),
    ),
)  # fmt: skip


@pytest.mark.parametrize(("after", "frame"), [(False, "elbow"), (True, "tip")])
def test_tip_displacement_due_to_a_bore_shift_equals_finite_motion(after, frame):
    """A shift of the bore in the crank moves the tip in the same direction.

    A shift of the bore in the rod moves the tip in the opposite direction.
    """
    datum = Datum("shoulder") if not after else Datum("tip")
    callout = Callout(
        "bore", "elbow", (datum,), after, extent=(0.02,), widths={"position": 2e-8}
    )
    home = home_posture(replace(SERIAL, callouts=(callout,)))
    (one,) = place_callouts(home)
    u = np.array([0.3, -0.4, 0.5, 0.2])
    errors = one.errors @ u
    assert np.flatnonzero(errors.any(axis=1)).tolist() == [SERIAL.index(frame)]
    # screw at the bore, in the elbow axes before or after the joint motion
    screw = one.zone.columns @ u
    angle = 0.5 + 0.7 * after
    R = np.array([[np.cos(angle), -np.sin(angle), 0],
                  [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])  # fmt: skip
    lever = R.T @ (np.array([np.cos(1.2), np.sin(1.2), 0]) * 0.3)
    sign = -1 if after else 1
    expected = sign * (R @ (screw[3:] + np.cross(screw[:3], lever)))
    moved = _platform(home, errors)[:3, 3] - _platform(home, 0 * errors)[:3, 3]
    assert moved == pytest.approx(expected, abs=1e-13)


def _platform(home, errors):
    """Return the platform pose for finite displacements of the frames."""
    frames = []
    for frame, e in zip(home.robot.frames, errors, strict=True):
        R = rotation_matrix(frame.rotation)
        turn = rotation_vector(R @ rotation_matrix(e[:3]))
        place = frame.translation + R @ e[3:]
        frames.append(replace(frame, translation=place, rotation=turn))
    robot = replace(home.robot, frames=tuple(frames), callouts=())
    q = {f.name: f.position for f in robot.frames if f.actuated}
    return place_robot(robot, joints=q).platform


@pytest.mark.parametrize(
    ("callouts", "message"),
    [
        ([hole(B), replace(hole(Datum("hole")), name="B", feature="B")],
         "datums that depend on each other"),
        ([replace(hole(A), datums=(Datum("tip"),))], "another body"),
        ([replace(hole(A), datums=(Datum("hole"),))], "the feature itself"),
        ([hole(A), hole(B)], "found the feature twice"),
        ([replace(hole(A), widths={"parallelism": 1e-5}, datums=(Datum("B"),))],
         "90 deg at home, expected 0 deg"),
        ([replace(hole(B), widths={}, length=(0.09, 1e-4))],
         "found a length of 90 mm, expected the length at home, 80 mm"),
        ([replace(hole(Datum("hole")), feature="tip", after=True)],
         "no frame carried by its joint"),
    ],
)  # fmt: skip
def test_callout_that_contradicts_its_feature_is_rejected(callouts, message):
    with pytest.raises(BadInput, match=message) as error:
        placed(PLATE, *callouts)
    assert "\n" not in str(error.value)


def test_length_tolerance_is_an_interval_along_the_distance():
    callout = replace(hole(B), widths={}, length=(0.08, 1e-4))
    (one,) = placed(PLATE, callout)
    assert one.zone.support(np.eye(6)[3]) == pytest.approx(1e-4)
    general = replace(hole(B), widths={}, general="ISO 2768-m")
    (one,) = placed(PLATE, general)
    assert one.zone.support(np.eye(6)[3]) == pytest.approx(0.3e-3)
    assert one.zone.dimensions == (1,)
