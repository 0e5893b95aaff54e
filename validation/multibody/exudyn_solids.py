"""Add meshed links to an Exudyn model as solids in floating frames."""

from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import identity

from forcefit.validation.multibody.exudyn_model import Model
from forcefit.validation.multibody.exudyn_parts import (
    Elastic,
    MeshBody,
    MeshedSolid,
    Modes,
    Place,
)
from forcefit.validation.multibody.motion import matrix, shifted


def add_mesh(model: Model, place: Place, body: MeshBody) -> Elastic:
    """Add a meshed body in a floating frame, with its unstressed tip at a body frame.

    The modes of the body are the static modes of its rigid interfaces
    (Hurty-Craig-Bampton).  Exudyn computes them from the full stiffness matrix.

    Args:
        model: model to which the body is added.
        place: body frame of the tip while the body is unstressed.
        body: the solid.

    Returns:
        The elastic body.
    """
    solid = body.solid
    floating = _floating(model.fem, solid)
    origin = place.moved(matrix(body.turn, -body.turn @ solid.centers[1]))
    numbers = floating.AddObjectFFRFreducedOrder(
        model.mbs,
        positionRef=origin.built[:3, 3].tolist(),
        rotationMatrixRef=origin.built[:3, :3],
    )
    number = int(numbers["oFFRFreducedOrder"])
    base = origin.moved(shifted(solid.centers[0]))
    markers = [_interface(model, number, solid, k) for k in range(2)]
    far = model.add_body(origin.moved(shifted(solid.centers[1])).built)
    for pair in (
        [model.add_marker(base), markers[0]],
        [markers[1], model.add_marker(far)],
    ):
        model.mbs.AddObject(model.item.GenericJoint(markerNumbers=pair))
    K = np.asarray(floating.stiffnessMatrixReduced)
    wrench = _tip_wrenches(body, np.asarray(floating.modeBasis), K)
    modes = Modes(int(numbers["nGenericODE2"]), K, wrench)
    tip = far.moved(matrix(body.turn.T, np.zeros(3)))
    return Elastic(place, tip, (number,), modes=modes)


def _interface(model: Model, number: int, solid: MeshedSolid, side: int) -> int:
    """Return a marker that moves with the base (0) or the tip (1)."""
    nodes = (solid.base, solid.tip)[side]
    arms = solid.nodes[nodes] - solid.centers[side]
    # The weighted mean of the nodes equals the reference point.
    rows = np.vstack([np.ones(len(arms)), arms.T / np.abs(arms).max()])
    weights = np.linalg.lstsq(rows, np.array([1.0, 0.0, 0.0, 0.0]))[0]
    marker = model.item.MarkerSuperElementRigid(
        bodyNumber=number, meshNodeNumbers=nodes.tolist(), weightingFactors=weights
    )
    return int(model.mbs.AddMarker(marker))


def _tip_wrenches(body: MeshBody, basis: NDArray, K: NDArray) -> NDArray:
    """Return the tip wrenches of unit modes, frame axes, (6, 6)."""
    solid = body.solid
    arms = solid.nodes[solid.tip] - solid.centers[1]
    rigid = np.zeros((len(arms), 3, 6))
    for k in range(3):
        rigid[:, :, k] = np.cross(np.eye(3)[k], arms)
        rigid[:, k, 3 + k] = 1.0
    moved = basis.reshape(-1, 3, basis.shape[1])[solid.tip]
    screws = np.linalg.lstsq(rigid.reshape(-1, 6), moved.reshape(-1, 6))[0]
    turn = np.kron(np.eye(2), body.turn)
    return turn @ np.linalg.solve(screws.T, K)


_CONDENSED: WeakKeyDictionary[MeshedSolid, Any] = WeakKeyDictionary()


def _floating(fem: Any, solid: MeshedSolid) -> Any:
    """Return the condensed solid with a floating frame."""
    if solid not in _CONDENSED:
        link = fem.FEMinterface()
        link.nodes = {"Position": solid.nodes}
        link.surface = [{"Name": "none", "Trigs": []}]
        link.stiffnessMatrix = solid.stiffness
        # Exudyn requires a mass matrix but does not use it here.
        link.massMatrix = identity(3 * len(solid.nodes), format="csr")
        link.ComputeHurtyCraigBamptonModes(
            [solid.base.tolist(), solid.tip.tolist()],
            0,
            computationMode=fem.HCBstaticModeSelection.RBE2,
        )
        _CONDENSED[solid] = fem.ObjectFFRFreducedOrderInterface(link)
    return _CONDENSED[solid]
