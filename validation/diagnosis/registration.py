"""Estimate the unknown pose of the measuring device."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from forcefit.assembly.effects import LIBRARY, apply_effects
from forcefit.assembly.effects.functions import in_session_alone
from forcefit.assembly.effects.registration import BASE
from forcefit.assembly.measurement.conditions import Conditions
from forcefit.assembly.measurement.predict import predict, with_second_order
from forcefit.inputs.table import BadInput
from forcefit.stiffness.screws import rotation_matrix, rotation_vector
from forcefit.validation.campaign.campaign import Campaign
from forcefit.validation.diagnosis.fit import fit_machine
from forcefit.validation.diagnosis.hypotheses import Hypothesis, Slot
from forcefit.validation.diagnosis.signatures import conditions_of
from forcefit.validation.diagnosis.unknowns import Acting, Unknowns

_FEWEST_POINTS = 3  # smallest number of points that determine a pose


def device_frame(declared: Conditions) -> Hypothesis:
    """Return the hypothesis that the pose of the measuring device is unknown."""
    unknowns = LIBRARY["registration"].unknowns(declared.robot)
    slots = (Slot((u.name,), u, u.start) for u in unknowns if u.name in BASE)
    return Hypothesis("registration", (), tuple(slots))


def register(campaign: Campaign, conditions: Conditions) -> Conditions:
    """Fit the pose of the measuring device to the declared model.

    Args:
        campaign: campaign with the rows from which the pose is estimated.
        conditions: measuring conditions to which the pose is added. Their rows may
            differ from the rows of ``campaign``.

    Returns:
        The conditions with the pose of the device in each session.

    Raises:
        BadInput: there are too few complete readings, or a session contains no usable
            row.
    """
    own = with_second_order(conditions_of(campaign))
    if campaign.session is None or conditions.session is None:
        return apply_effects(conditions, _device(campaign, own))
    for session in dict.fromkeys(conditions.session.tolist()):
        rows = campaign.session == session
        if not rows.any():
            raise BadInput(
                f'{campaign.name}: found no usable row in session "{session}", '
                "expected at least one from which its registration is computed"
            )
        device = _device(campaign.take(rows), own.take(rows))
        turned = apply_effects(conditions, device)
        conditions = in_session_alone(conditions, turned, session)
    return conditions


def _device(campaign: Campaign, own: Conditions) -> dict[str, dict[str, float]]:
    """Return the fitted pose of the device as an effect."""
    start, frame = coarse_frame(campaign, own), device_frame(own)
    begin = np.array([start[name] for name in BASE])
    unknowns = Unknowns(campaign.robot, (Acting(frame, begin, None, True),))
    fit = fit_machine(campaign, unknowns, np.ones(len(campaign), dtype=bool))
    return {"registration": dict(zip(BASE, fit.x.tolist(), strict=True))}


def coarse_frame(campaign: Campaign, conditions: Conditions) -> dict[str, float]:
    """Return a start value for the pose of the device."""
    model = predict(conditions).deviation
    nominal = conditions.measured_points
    answered = np.isfinite(model).all(axis=1)
    full = answered & np.isfinite(campaign.measured[:, 3:]).all(axis=1)
    turned = answered & np.isfinite(campaign.measured[:, :3]).all(axis=1)
    seen = (nominal + campaign.measured[:, 3:])[full]
    thought = (nominal + model[:, 3:])[full]
    if not turned.any() and not off_one_line(thought):
        # The fit was requested by a command option.
        known = campaign.registration == "known"
        found = "a fit of the registration" if known else "an unknown registration"
        instead = "--fit zeros" if known else 'registration = "known" in campaign.toml'
        raise BadInput(
            f"{campaign.name}: found {found}, but neither rotations nor "
            f"{_FEWEST_POINTS} measured points that are not on one line (x, y and z); "
            f"expected rotations or such points, or {instead}"
        )
    parts = campaign.measured[turned, :3], model[turned, :3]
    turns = [rotation_matrix(vectors) for vectors in parts]
    R = device_rotation(thought, seen, turns[1], turns[0])
    shift = (seen - thought @ R.T).mean(axis=0) if len(seen) else np.zeros(3)
    vector = rotation_vector(R)
    return dict(zip(BASE, np.concatenate([vector, shift]).tolist(), strict=True))


def device_rotation(
    points: NDArray, seen: NDArray, turns: NDArray, seen_turns: NDArray
) -> NDArray:
    """Return the rotation of the device, fitted to orientations or to points.

    Args:
        points: (P, 3) [m] points in base axes. Points are used only if there are no
            orientations.
        seen: (P, 3) [m] the same points in the axes of the device.
        turns: (T, 3, 3) orientations in base axes.
        seen_turns: (T, 3, 3) the same orientations in the axes of the device.

    Returns:
        (3, 3) rotation from base axes to device axes.
    """
    if len(turns):
        gap = seen_turns @ np.swapaxes(turns, 1, 2)
        return Rotation.from_matrix(gap).mean().as_matrix()
    # The rotation is the same if only one of the two sets of points is centred.
    centred = points - points.mean(axis=0)
    return Rotation.align_vectors(seen, centred)[0].as_matrix()


def off_one_line(points: NDArray) -> bool:
    """Return whether points (P, 3) are not collinear."""
    if len(points) < _FEWEST_POINTS:
        return False
    size = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return bool(size[1] > 1e-3 * size[0])
