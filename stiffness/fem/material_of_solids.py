"""Materials of the solids in a STEP file."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from forcefit.inputs.table import BadInput, nearest, quoted
from forcefit.stiffness.fem.material import Material
from forcefit.stiffness.mesh.cut_face import CutFace
from forcefit.stiffness.surface.filled_solids import FilledSolids
from forcefit.stiffness.surface.recognition import recognise
from forcefit.stiffness.surface.surface import Surface, orient_shells
from forcefit.stiffness.surface.triangle_graph import TriangleGraph


def placed_materials(
    surface: Surface, materials: Sequence[Material]
) -> tuple[Material, ...]:
    """Find the region of each material that is assigned to solids in a STEP file.

    Args:
        surface: surface of the link.
        materials: materials of the link. Either the first material is not assigned to a
            solid and is used for the whole link, or each solid has a material.

    Returns:
        The materials with regions in place of the names of solids.

    Raises:
        BadInput: a solid does not exist, has no material or overlaps another solid.
    """
    named = [material for material in materials if material.solid]
    if not named:
        return tuple(materials)
    solids = surface.solids
    if solids is None:
        raise BadInput(
            f"{surface.name}: found a material of solid "
            f"{quoted(named[0].solid)}, expected a STEP file whose solids are "
            "read as one part, such as part.step#*"
        )
    if solids.overlaps:
        raise BadInput(
            f"{surface.name}: {solids.overlaps[0]}; expected solids that touch "
            "without overlap, so that the material is unique"
        )
    members = [_members(surface.name, solids, material) for material in materials]
    if materials[0].solid:
        given = {name for names in members for name in names}
        lacking = [name for name in solids.names if name not in given]
        if lacking:
            raise BadInput(
                f"{surface.name}: solid {quoted(lacking[0])} has no material; "
                "expected a material of this solid, or a first material for the whole "
                "link"
            )
    placed = [
        _placed(solids, names, material) if material.solid else material
        for names, material in zip(members, materials, strict=True)
    ]
    # if each solid has a material, the first is also used outside all solids
    first = replace(materials[0], solid="") if materials[0].solid else materials[0]
    return first, *placed[1:]


def _members(name: str, solids: FilledSolids, material: Material) -> tuple[str, ...]:
    """Return the names of the solids of a material."""
    text = material.solid
    names = (text,) if text in solids.names or not text else tuple(text.split("+"))
    for one in names if text else ():
        if one not in solids.names:
            hint = nearest(one, solids.names)
            raise BadInput(f"{name}: no solid {quoted(one)}{hint}")
    return names if text else ()


def _placed(
    solids: FilledSolids, names: tuple[str, ...], material: Material
) -> Material:
    """Replace the names of solids by their region and its faces."""
    triangles, within = solids.around(names)
    triangles = orient_shells(triangles)[0]
    used, index = np.unique(triangles, return_inverse=True)
    bound = Surface(solids.points[used], index.reshape(-1, 3), ", ".join(names))
    graph = TriangleGraph(bound)
    faces = [
        CutFace(shape, graph.lifted(piece))
        for part in graph.smooth_parts(within)
        for piece, shape in recognise(graph, part)
    ]
    return replace(
        material, solid="", where=partial(_enclosed, bound), faces=tuple(faces)
    )


def _enclosed(bound: Surface, points: NDArray) -> NDArray:
    """Return whether each point is inside a closed surface, (n,)."""
    import pyvista
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkFiltersModeling import vtkSelectEnclosedPoints

    inside = vtkSelectEnclosedPoints()
    inside.SetTolerance(1e-9)
    inside.SetInputData(pyvista.PolyData(points))
    inside.SetSurfaceData(
        pyvista.PolyData.from_regular_faces(bound.points, bound.triangles)
    )
    inside.Update()
    chosen = inside.GetOutput().GetPointData().GetArray("SelectedPoints")
    return np.asarray(vtk_to_numpy(chosen)) > 0
