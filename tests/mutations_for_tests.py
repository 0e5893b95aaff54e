"""Mutations of the virtual joint model, each of which a test must detect."""

import numpy as np


def _scaled(where, name, factor):
    def mutate(monkeypatch):
        import importlib

        module = importlib.import_module(where)
        right = getattr(module, name)
        monkeypatch.setattr(module, name, lambda *a, **k: factor * right(*a, **k))

    return mutate


def _lever(change):
    """Change the block [p_j - p]x R of the adjoint matrix."""

    def mutate(monkeypatch):
        import forcefit.assembly.kinematics.posture

        right = forcefit.assembly.kinematics.posture.screw_map

        def wrong(offset, rotation=None):
            A = right(offset, rotation).copy()
            A[..., 3:, :3] = change(A[..., 3:, :3])
            return A

        monkeypatch.setattr(forcefit.assembly.kinematics.posture, "screw_map", wrong)

    return mutate


def _signs(change):
    def mutate(monkeypatch):
        import forcefit.assembly.linear.closure

        right = forcefit.assembly.linear.closure.closure_signs
        monkeypatch.setattr(
            forcefit.assembly.linear.closure,
            "closure_signs",
            lambda robot: change(right(robot)),
        )

    return mutate


def _beam(row, column, factor):
    """Scale one entry of the compliance of every beam, in section axes."""

    def mutate(monkeypatch):
        import forcefit.stiffness.beam.beam

        right = forcefit.stiffness.beam.beam._compliance_in_section_axes

        def wrong(*args):
            C = right(*args)
            C[row, column] *= factor
            C[column, row] = C[row, column]
            return C

        monkeypatch.setattr(
            forcefit.stiffness.beam.beam, "_compliance_in_section_axes", wrong
        )

    return mutate


def _shifted_errors(monkeypatch):
    """Apply errors at the parent frame instead of the frame, as printed in eq. (14)."""
    from forcefit.assembly.kinematics.posture import Posture
    from forcefit.stiffness.screws import screw_map

    def wrong(self):
        T = np.concatenate([np.eye(4)[None], self.transforms])[self.robot.parents + 1]
        return screw_map(T[:, :3, 3] - self.platform[:3, 3], T[:, :3, :3])

    monkeypatch.setattr(Posture, "paths", property(wrong))


def _no_rotation(monkeypatch):
    import forcefit.assembly.kinematics.posture

    right = forcefit.assembly.kinematics.posture.screw_map
    monkeypatch.setattr(
        forcefit.assembly.kinematics.posture,
        "screw_map",
        lambda offset, rotation=None: right(offset),
    )


MUTATIONS = {
    "lever arm missing": _lever(lambda block: 0.0 * block),
    "lever arm of the wrong sign": _lever(lambda block: -block),
    "lever arm one per cent short": _lever(lambda block: 0.99 * block),
    "axes of the frames forgotten": _no_rotation,
    "eq. (14) as printed": _shifted_errors,
    "second chain added, not subtracted": _signs(np.abs),
    "second chain counted twice": _signs(lambda s: np.where(s < 0, 2 * s, s)),
    "links twice as soft": _scaled(
        "forcefit.assembly.linear.closure", "link_compliances", 2.0
    ),
    "links half a per cent stiff": _scaled(
        "forcefit.assembly.linear.closure", "link_compliances", 0.995
    ),
    "joints twice as soft": _scaled(
        "forcefit.assembly.linear.closure", "spring_compliances", 2.0
    ),
    "joints rigid": _scaled(
        "forcefit.assembly.linear.closure", "spring_compliances", 1e-9
    ),
}

BEAM_MUTATIONS = {
    "torsion halved": _beam(0, 0, 0.5),
    "bending about y a tenth stiffer": _beam(1, 1, 0.9),
    "bending about z a tenth softer": _beam(2, 2, 1.1),
    "axial compliance doubled": _beam(3, 3, 2.0),
    "deflection along y L^3/3.75": _beam(4, 4, 0.8),
    "deflection along z L^3/2.7": _beam(5, 5, 1.1),
    "coupling in the x-z plane of the wrong sign": _beam(1, 5, -1.0),
    "coupling in the x-y plane of the wrong sign": _beam(2, 4, -1.0),
    "coupling in the x-y plane gone": _beam(2, 4, 0.0),
}
