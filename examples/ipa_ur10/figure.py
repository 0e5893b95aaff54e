"""Each joint's angle error against its own angle, in both series."""

from pathlib import Path

from matplotlib.figure import Figure

from examples.ipa_ur10.convert import JOINTS


def draw(errors: dict, out: Path) -> Path:
    """One panel a joint.

    Args:
        errors: by series, angles and errors (k, 6) [rad].
        out: folder of ``joint_errors.png``.

    Returns:
        The picture's path.
    """
    figure = Figure(figsize=(12, 9), layout="constrained")
    for k, panel in enumerate(figure.subplots(3, 2).ravel()):
        for (series, (q, e)), size in zip(errors.items(), (1.0, 2.5), strict=True):
            panel.plot(q[:, k], e[:, k] * 1e3, ".", ms=size, label=series)
        panel.set(title=JOINTS[k], xlabel="angle [rad]", ylabel="error [mrad]")
        panel.set_ylim(-1.5, 1.5)
    panel.legend(markerscale=4)
    path = out / "joint_errors.png"
    figure.savefig(path, dpi=70)
    return path
