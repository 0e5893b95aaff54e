"""Simulated measurements of a planar arm with two drives and two beams.

The simulation is independent of forcefit.  Joint rotations are finite, and the links
are Euler-Bernoulli cantilevers.
"""

import numpy as np
from scipy.spatial.transform import Rotation

from forcefit.validation.campaign.campaign_file import read_campaign
from tests.campaigns_for_tests import write_campaign

L1, L2, RADIUS, E = 0.6, 0.45, 0.03, 70e9
AREA, I = np.pi * RADIUS**2, np.pi * RADIUS**4 / 4
SIGMA = np.array([1e-5] * 3 + [5e-6] * 3)
BEAM = (
    f"link = {{ beam = {{ radius = {RADIUS}, theory = 'euler' }}, young = {E}, "
    "poisson = 0.33, density = 2700.0 }\n"
)
PLANAR = f"""
name = "planar"
platform = "tool"
[[frame]]
name = "one"
parent = "base"
joint = "revolute"
actuated = true
[[frame]]
name = "two"
parent = "one"
translation = [{L1}, 0, 0]
joint = "revolute"
actuated = true
position = 1.0
{BEAM}
[[frame]]
name = "tool"
parent = "two"
translation = [{L2}, 0, 0]
{BEAM}
"""
CELLS = ("rx", "ry", "rz", "tx", "ty", "tz")
HEAD = ",".join([
    "id", "q.one", "q.two", "load.mz", "load.fx", "load.fy",
    *(f"meas.{c}" for c in CELLS), "cov.temperature", "cov.time", "cov.approach",
])  # fmt: skip


def turned(angle, x, y):
    """Rotate a vector in the plane."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([c * x - s * y, s * x + c * y])


def bent(force, moment, angle, length):
    """Return the tip deflection (x, y) and rotation of a cantilever.

    The force is given in base axes, and the result in the axes of the beam.
    """
    along, across = turned(-angle, *force)
    y = across * length**3 / (3 * E * I) + moment * length**2 / (2 * E * I)
    turn = across * length**2 / (2 * E * I) + moment * length / (E * I)
    return along * length / (E * AREA), y, turn


def reading(q, load, temperature, offset=(0.0, 0.0), stiffness=(np.inf, np.inf),
            longer=(0.0, 0.0), expansion=(0.0, 0.0)):  # fmt: skip
    """Return the deviation of the tool, (6,) [rad, m], due to loads and errors."""
    mz, force = load[0], np.array(load[1:])
    elbow = turned(q[0], L1, 0.0)
    tool = elbow + turned(q[0] + q[1], L2, 0.0)
    at_one = mz + tool[0] * force[1] - tool[1] * force[0]
    at_two = mz + (tool - elbow)[0] * force[1] - (tool - elbow)[1] * force[0]
    lengths = [
        L * (1 + a * temperature) + more
        for L, a, more in zip((L1, L2), expansion, longer, strict=True)
    ]
    angle = q[0] + offset[0] + at_one / stiffness[0]
    x, y, turn = bent(force, at_two, q[0], L1)
    place = turned(angle, lengths[0] + x, y)
    angle += turn + q[1] + offset[1] + at_two / stiffness[1]
    x, y, turn = bent(force, mz, q[0] + q[1], L2)
    place = place + turned(angle, lengths[1] + x, y)
    return np.array([0, 0, angle + turn - q[0] - q[1], *(place - tool), 0])


def measure(folder, seed=0, configurations=16, passes=4, temperature=None, device=None,
            outliers=(), missing=0.0, stand=0.0, noise=1.0, force=30.0,
            **effects):  # fmt: skip
    """Write a simulated campaign, and return its folder.

    Args:
        folder: folder to write.
        seed: random seed.
        configurations: number of configurations.
        passes: number of passes through all configurations.
        temperature: constant temperature [K]; by default, it varies with time.
        device: rotation and translation of an unknown measuring frame.
        outliers: numbers of the rows with an outlier.
        missing: fraction of missing readings.
        stand: size [sigma] of a deviation proportional to the squared load.
        noise: factor on the measurement noise.
        force: largest force [N].
        effects: arguments of :func:`reading`.
    """
    rng = np.random.default_rng(seed)
    q = rng.uniform([-1.2, 0.4], [1.2, 2.0], (configurations, 2))
    rows = np.concatenate([rng.permutation(configurations) for _ in range(passes)])
    angle = rng.uniform(0, 2 * np.pi, len(rows))
    size = force * rng.choice([0.0, 0.5, 1.0], len(rows))
    loads = np.column_stack([
        0.1 * size * rng.choice([-1, 0, 1], len(rows)),
        size * np.cos(angle), size * np.sin(angle),
    ])  # fmt: skip
    time = 60.0 * np.arange(len(rows))
    T = 4 * np.sin(time / 700) + 1 if temperature is None else 0 * time + temperature
    lines = []
    for i, k in enumerate(rows):
        seen = reading(q[k], loads[i], T[i], **effects)
        if stand:
            part = stand * (size[i] / force) ** 2
            seen = seen + part * SIGMA * [1, -1, 1, -1, 1, 1]
        if device is not None:
            tool = [*turned(q[k][0], L1, 0), 0.0]
            tool += np.array([*turned(q[k].sum(), L2, 0), 0.0])
            turn = device[0] * Rotation.from_rotvec(seen[:3])
            place = device[0].apply(tool + seen[3:]) + device[1] - tool
            seen = np.concatenate([turn.as_rotvec(), place])
        seen = seen + noise * SIGMA * rng.normal(size=6)
        if i in outliers:
            seen[3] += 40 * SIGMA[3]
        cells = ["" if rng.random() < missing else repr(float(x)) for x in seen]
        words = [*q[k], *loads[i], *cells, T[i], time[i], rng.choice([-1, 1])]
        lines.append(",".join([f"m{i}", *map(str, words)]))
    toml = {"registration": '"unknown"'} if device is not None else None
    return write_campaign(folder, HEAD, lines, robot=PLANAR, toml=toml)


def measured(folder, **given):
    """Write a simulated campaign, and read it."""
    return read_campaign(measure(folder, **given))
