"""Create the surfaces in this folder: ``python meshes/make.py`` (needs manifold3d).

Lengths are in metres. The axis of each link is z, and the base interface is at z = 0.
"""

from pathlib import Path

import manifold3d as m3
import numpy as np

HERE = Path(__file__).parent
LENGTH = 0.452  # [m] distance between the joints of the IRSBot-2 distal link


def bar(radius, z0, z1, facets, tip_radius=None):
    """Return a round bar or a cone along z."""
    tip_radius = radius if tip_radius is None else tip_radius
    solid = m3.Manifold.cylinder(z1 - z0, radius, tip_radius, facets)
    return solid.translate((0, 0, z0))


def block(low, high):
    """Return a box between two corners."""
    size = np.subtract(high, low)
    return m3.Manifold.cube(tuple(size)).translate(tuple(low))


def pin(radius, y0, y1, z, facets):
    """Return a round bar along y whose axis is at x = 0 and height z."""
    solid = m3.Manifold.cylinder(y1 - y0, radius, radius, facets)
    return solid.rotate((-90, 0, 0)).translate((0, y0, z))


def distal_plain():
    """Return the IRSBot-2 distal link of the paper, which is a round bar."""
    return bar(0.040, 0.0, LENGTH, 64)


def fork():
    """Return the end of a tube with two lugs, which have a bore along y."""
    solid = bar(0.040, 0.042, 0.060, 96) - bar(0.015, 0.03, 0.07, 48)
    for y0, y1 in ((0.016, 0.030), (-0.030, -0.016)):
        lug = block((-0.025, y0, 0.0), (0.025, y1, 0.045)) + pin(0.025, y0, y1, 0, 64)
        solid += lug - bar(0.015, 0.03, 0.07, 48)
    return solid - pin(0.011, -0.05, 0.05, 0.0, 64)


def distal_forks():
    """Return a distal link with details: a tube with forks at both ends."""
    tube = bar(0.040, 0.060, LENGTH - 0.060, 96) - bar(0.034, 0.0, LENGTH, 96)
    tip = fork().mirror((0, 0, 1)).translate((0, 0, LENGTH))
    return fork() + tube + tip


def tube():
    """Return a tube of 60 x 4 mm with a length of 400 mm."""
    return bar(0.030, 0.0, 0.4, 64) - bar(0.026, -0.1, 0.5, 64)


def tapered_arm():
    """Return a solid cone with radii of 45 mm and 25 mm and a length of 350 mm."""
    return bar(0.045, 0.0, 0.35, 64, tip_radius=0.025)


def l_bracket():
    """Return an L-shaped bar: 0.2 m along z, then 0.15 m along x."""
    leg = block((-0.02, -0.02, 0.0), (0.02, 0.02, 0.22))
    return leg + block((-0.02, -0.02, 0.18), (0.15, 0.02, 0.22))


def delta_forearm():
    """Return a rod of the forearm of a Delta robot: a tube with solid ends."""
    head = bar(0.012, 0.0, 0.030, 48)
    rod = bar(0.007, 0.030, 0.370, 48) - bar(0.005, 0.030, 0.370, 48)
    return head + rod + head.translate((0, 0, 0.370))


def save_stl(solid, path):
    """Write a binary STL file."""
    mesh = solid.to_mesh()
    points = np.asarray(mesh.vert_properties, dtype=np.float64)[:, :3]
    corners = points[np.asarray(mesh.tri_verts)].astype("<f4")
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    size = np.linalg.norm(normals, axis=1, keepdims=True)
    record = np.zeros(len(corners), dtype=[("f", "<f4", (4, 3)), ("a", "<u2")])
    record["f"][:, 0] = normals / np.where(size > 0, size, 1)
    record["f"][:, 1:] = corners
    header = b"forcefit " + path.stem.encode()
    count = np.uint32(len(corners)).tobytes()
    path.write_bytes(header.ljust(80, b"\0") + count + record.tobytes())


if __name__ == "__main__":
    for make in (
        distal_plain,
        distal_forks,
        tube,
        tapered_arm,
        l_bracket,
        delta_forearm,
    ):
        save_stl(make(), HERE / f"{make.__name__}.stl")
