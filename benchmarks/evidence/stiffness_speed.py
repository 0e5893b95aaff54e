"""Compare time and true error of K_E with NGSolve and CalculiX.

``python benchmarks/evidence/stiffness_speed.py`` requires NGSolve (``pip install
ngsolve``) and the command ``ccx`` of CalculiX.

Each case runs in a separate process.  The table contains the processor time, including
child processes and imports, and the peak memory.  True errors refer to
``stiffness_references.json``.  The cases are:

- forcefit: from the STL surface to K with its error estimate, including the mesher.
  Assembly, factorisation and six load cases on the last mesh are also measured
  separately.
- NGSolve: from the exact geometry to K with curved elements.  The order and the mesh
  are given, and there is no error estimate.
- CalculiX: a load case on a given mesh of forcefit with quadratic elements.  The mesh
  is refined until the true error is sufficiently small, and this time is not included.
"""

import argparse
import json
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

START = time.monotonic()
HERE = Path(__file__).parent
WHO = resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN
BORE = "bore=0,0,{}/0,1,0/0.011"
INTERFACES = {
    "distal_plain": ("z=0", "z=0.452"),
    "l_bracket": ("z=0", "x=0.15"),
    "distal_forks": (BORE.format(0), BORE.format(0.452)),
}
CASES = [
    "ours distal_plain 0.01", "ours distal_plain 0.001",
    "ngsolve distal_plain 2 0 1", "ngsolve distal_plain 3 0 1",
    "ngsolve distal_plain 3 1 1", "ngsolve distal_plain 4 1 1",
    "ccx distal_plain 0.01", "ccx distal_plain 0.001",
    "ours l_bracket 0.01", "ours l_bracket 0.001",
    "ngsolve l_bracket 3 2 1", "ngsolve l_bracket 4 2 1",
    "ngsolve l_bracket 4 3 1.5", "ccx l_bracket 0.01", "ccx l_bracket 0.001",
    "ours distal_forks 0.01", "ours distal_forks 0.005", "ours distal_forks 0.001",
    "ngsolve distal_forks 3 0 1", "ngsolve distal_forks 3 1 0.8",
    "ngsolve distal_forks 4 1 0.7", "ccx distal_forks 0.01",
]  # fmt: skip


def true_error(name, K):
    """Return the largest entry of K - K_ref, relative to sqrt(K_ii K_jj)."""
    stored = json.loads((HERE / "stiffness_references.json").read_text())
    K, exact = (
        np.asarray(getattr(K, "stiffness", K)),
        np.array(stored[name]["stiffness"]),
    )
    size = np.sqrt(np.diag(exact))
    return float(np.abs((K - exact) / np.outer(size, size)).max())


def given(name):
    """Return the surface of a link, its interfaces and their centres."""
    from forcefit.stiffness.fem.fea import interface_center
    from forcefit.stiffness.surface.interface import parse_interface
    from forcefit.stiffness.surface.surface import read_surface

    surface = read_surface(HERE.parents[1] / "meshes" / f"{name}.stl")
    faces = [parse_interface(text) for text in INTERFACES[name]]
    centers = [interface_center(surface, face, "face") for face in faces]
    return surface, faces, np.array(centers)


def ours(name, accuracy):
    """Measure the time of forcefit from the surface to K, and on the last mesh."""
    from forcefit.stiffness.fem.condensation import condense
    from forcefit.stiffness.fem.fea import Budget, FemOptions, solve_link
    from forcefit.stiffness.fem.material import Material

    surface, faces, _ = given(name)
    with tempfile.TemporaryDirectory() as folder:
        solved = solve_link(surface, *faces, [Material(60e9, 0.3)],
            options=FemOptions(float(accuracy), budget=Budget(seconds=7200),
                               cache=Path(folder)))  # fmt: skip
    whole, wall, level = used(), time.monotonic() - START, solved.level
    condense(level.mesh, *level.material.T[:2], solved.centers)
    link = solved.link
    row = {"estimate": link.relative_error_estimate, "seconds": whole, "wall": wall}
    return link, link.mesh["unknowns"], row | {"last_mesh": used() - whole}


def used():
    """Return the processor time [s] of this process and its children."""
    uses = [resource.getrusage(w) for w in WHO]
    return sum(u.ru_utime + u.ru_stime for u in uses)


def ngsolve(name, order, layers, finer):
    """Measure the time of NGSolve from the exact geometry to K."""
    sys.path.insert(0, str(HERE))
    import stiffness_references as references

    mesh, _ = references.netgen_mesh(name, int(layers), float(finer))
    mesh.Curve(int(order))
    K, unknowns = references.stiffness(mesh, int(order), references.LINKS[name][1])
    return K, unknowns, {}


def quadratic(name, accuracy):
    """Return a quadratic mesh with a given true error, its K and its unknowns."""
    from forcefit.stiffness.fem.adaptive_step import refine_level, solve_level
    from forcefit.stiffness.fem.condensation import condense
    from forcefit.stiffness.fem.elements import isoparametric
    from forcefit.stiffness.fem.fea import Budget, first_mesh
    from forcefit.stiffness.fem.material import Material
    from forcefit.stiffness.mesh.edge_grading import ENDS, layered

    surface, faces, centers = given(name)
    solid = first_mesh(surface, *faces, Budget())
    while True:
        level = solve_level(solid, [Material(60e9, 0.3)], centers, "rigid")
        mesh = isoparametric(level.solid, 2, layered(level.solid, ENDS))
        lam, mu = level.material.T[:2]
        solved = condense(mesh, lam, mu, centers)
        if true_error(name, solved.stiffness) <= accuracy:
            return mesh, solved
        solid = refine_level(level, 1.3)


def ccx(name, accuracy):
    """Measure the time of one load case of CalculiX on a mesh of forcefit."""
    with tempfile.TemporaryDirectory() as folder:
        mesh, solved = quadratic(name, float(accuracy))
        points = mesh.nodes[mesh.cells[:, :4]]
        turned = np.linalg.det(points[:, 1:] - points[:, :1]) < 0
        cells = mesh.cells[:, [0, 1, 2, 3, 4, 7, 5, 6, 8, 9]]
        # exchanging corners 0 and 1 also exchanges the edges at corners 2 and 3
        cells[turned] = cells[turned][:, [1, 0, 2, 3, 4, 6, 5, 8, 7, 9]]
        tip = np.unique(mesh.faces[mesh.patch == 1])
        base = np.unique(mesh.faces[mesh.patch == 0])
        lines = ["*NODE, NSET=ALL"]
        lines += [f"{k}, " + ", ".join(f"{v:.11e}" for v in p)
                  for k, p in enumerate(mesh.nodes, 1)]  # fmt: skip
        lines.append("*ELEMENT, TYPE=C3D10, ELSET=SOLID")
        lines += [f"{k}, " + ", ".join(str(n + 1) for n in cell)
                  for k, cell in enumerate(cells, 1)]  # fmt: skip
        for word, nodes in (("TIP", tip), ("BASE", base)):
            lines += [f"*NSET, NSET={word}", *(f"{n + 1}," for n in nodes)]
        lines += ["*MATERIAL, NAME=M", "*ELASTIC", "60e9, 0.3",
                  "*SOLID SECTION, ELSET=SOLID, MATERIAL=M",
                  "*STEP", "*STATIC", "*BOUNDARY", "BASE, 1, 3, 0",
                  "TIP, 1, 1, 1", "TIP, 2, 3, 0",
                  "*NODE PRINT, NSET=TIP, TOTALS=ONLY", "RF", "*END STEP"]  # fmt: skip
        Path(folder, "job.inp").write_text("\n".join(lines) + "\n")
        before, begun = used(), time.monotonic()
        subprocess.run(
            ["ccx", "job"], cwd=folder, check=True, capture_output=True, timeout=1800
        )
        seconds, wall = used() - before, time.monotonic() - begun
        numbers = Path(folder, "job.dat").read_text().split()
    force = float(numbers[-3])
    ratio = force / solved.stiffness[3, 3] - 1
    print(f"ccx / ours - 1 of K_TX on the same mesh: {ratio:.1e}", file=sys.stderr)
    return solved.stiffness, solved.unknowns, {"seconds": seconds, "wall": wall}


def run_case(words):
    """Run a case in this process, and print its result as JSON."""
    kind, name, *options = words
    K, unknowns, more = {"ours": ours, "ngsolve": ngsolve, "ccx": ccx}[kind](
        name, *options
    )
    memory = resource.getrusage(WHO[kind == "ccx"]).ru_maxrss / 1e6
    row = {"seconds": used(), "wall": time.monotonic() - START}
    row |= {"estimate": None, "last_mesh": None}
    row |= {"unknowns": unknowns, "true_error": true_error(name, K), "memory": memory}
    print(json.dumps(row | more))


def main(cases):
    """Run all cases and print a row of the table for each."""
    print(
        "case                            unknowns  true error  estimate  CPU s"
        "  last mesh  wall s     GB"
    )
    for case in cases:
        if case.startswith("ccx") and shutil.which("ccx") is None:
            print(f"{case}: the command ccx was not found")
            continue
        command = [sys.executable, __file__, "--case", *case.split()]
        run = subprocess.run(command, capture_output=True, text=True, check=False)
        if run.returncode:
            print(
                f"{case:30} failed: {run.stderr.strip().splitlines()[-1:]}", flush=True
            )
            continue
        r = json.loads(run.stdout.strip().splitlines()[-1])
        estimate = f"{100 * r['estimate']:.3f} %" if r["estimate"] else "-"
        last = f"{r['last_mesh']:.1f}" if r["last_mesh"] else "-"
        print(
            f"{case:30} {r['unknowns']:9d} {100 * r['true_error']:9.4f} % "
            f"{estimate:>9} "
            f"{r['seconds']:6.1f} {last:>10} {r['wall']:7.1f} {r['memory']:6.2f}",
            flush=True,
        )


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--case", nargs="+", help=argparse.SUPPRESS)
    parser.add_argument("cases", nargs="*", help='such as "ours distal_plain 0.001"')
    asked = parser.parse_args()
    if asked.case:
        run_case(asked.case)
    else:
        main(asked.cases or CASES)
