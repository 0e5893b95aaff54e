"""Valid files of robots with loops and of measured robots, and commands that read them.

The files include robots with loops, a robot whose loops are open because of rounded
dimensions, a campaign with its identified robot, exports of measuring devices, and
surfaces in all formats.
"""

from importlib.util import find_spec
from pathlib import Path

from fuzz_seeds import BAR, OBJECT

# parallelogram linkage with a pin 20 um out of plane, so that its loops are open
ROUNDED = BAR.replace(
    "translation = [0.5, 0.0, 0.0]", "translation = [0.5, 0.0, 2e-5]", 1
)
SERVICE = """
robot = "delta.toml"
grid = "tx=-0.01:0.01:0.02"
[service]
load = [0, 0, 0, 0, 0, -100]
stiffness = true
[checks]
crosscheck = false
picture = false
"""
VECTORS = {"A": (0, 0, 0.1), "B": (0.1, 0.02, 0), "C": (0, 0.07, 0.03)}

MACHINES = [
    (5, "assembly solve delta.toml --quantities margin --json -"),
    (3, "assembly solve delta.toml --load fz=-100 --gravity z=-9.81"),
    (3, "assembly stiffness delta.toml --along tz=1 --json -"),
    (2, "assembly deflection delta.toml --along fz=0:-100:50 --figure new.svg"),
    (2, "assembly frequencies delta.toml --count 3 --json new.json"),
    (3, "assembly sweep delta.toml --grid tx=0:0.01:0.01 -o new.nc --state nominal "
        "--csv new.csv"),
    (4, "assembly solve rounded.toml --quantities margin --rest coupler --json -"),
    (2, "assembly plot swept.nc --csv new.csv"),
    (2, "convert delta.toml -o new.urdf"),
    (3, "study service.toml -o newstudy"),
    (6, "validation predict saved.toml learnt -o new.csv --json -"),
    (4, "validation predict saved.toml targets.csv -o new.csv"),
    (4, "validation compensate saved.toml targets.csv -o new.csv --diagnosed "
        "diagnosed.json"),
    (4, "validation carry saved.toml learnt --setup 4 -o new.toml"),
    (3, "validation explain curved.toml --figure new.svg"),
    (4, "validation inspect learnt --iso --json -"),
    (2, "validation plan saved.toml -o newfolder --rows 8 --configurations 8"),
    (3, "validation inspect learnt"),
    (4, "validation import leica.csv --targets smr.toml --commands commands.csv "
        "-o newfolder"),
    (4, "validation import faro.txt --targets smr.toml --commands commands.csv "
        "-o newfolder --json -"),
    (4, "validation import wide.csv --targets smr.toml --commands commands.csv "
        "-o newfolder"),
    (4, "validation import german.csv --targets comma.toml --commands commands.csv "
        "-o newfolder"),
    (3, "stiffness fea solid.ply --base z=0 --tip z=7 --young 7e10 --poisson 0.3"),
    (3, "stiffness fea solidtext.stl --base z=0 --tip z=7 --young 7e10 --poisson 0.3"),
    (3, "stiffness fea solid.vtk --base z=0 --tip z=7 --young 7e10 --poisson 0.3"),
    (3, "stiffness fea solid.msh --base z=0 --tip z=7 --young 7e10 --poisson 0.3"),
]  # fmt: skip

# commands for STEP files, which are omitted without the optional package gmsh
STEP = [
    (4, "stiffness fea two.step --part list --json -"),
    (3, "stiffness fea two.step#solid1 --base z=0 --tip z=7 --young 7e10 --poisson "
        "0.3"),
] if find_spec("gmsh") else []  # fmt: skip

MADE_MACHINES = [
    "convert delta -o delta.toml",
    "validation generate campaign/robot.toml learnt --truth truth.json --effect "
    "encoder_offset=3 --configurations 12 --rows 30",
    "validation diagnose learnt --save saved.toml --json diagnosed.json",
]


def write_machines(folder: Path) -> None:
    """Write all files that are not written by commands.

    Args:
        folder: folder with ``arm.toml``, ``smr.toml`` and ``campaign/robot.toml``.
    """
    curved = (folder / "campaign/robot.toml").read_text() + (
        '[[effect]]\nname = "function"\nlabel = "gear"\nwhere = "two"\n'
        'components = ["rz"]\nvariables = ["q.two"]\nform = "waves"\n'
        'parameters = { "1.sine" = 1e-4, "1.cosine" = -3e-5 }\n'
    )
    comma = (folder / "smr.toml").read_text().replace("[targets]", 'decimal = ","\n'
                                                      "[targets]", 1)  # fmt: skip
    texts = {
        "rounded.toml": ROUNDED, "service.toml": SERVICE,
        "curved.toml": curved, "comma.toml": comma, **_exports(folder),
        "targets.csv": "id,q.one,q.two\na,0.1,0.3\nb,-0.2,0.5\n",
        **_surfaces(),
    }  # fmt: skip
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="latin-1")
    if STEP:
        _write_step(folder / "two.step")


def _exports(folder: Path) -> dict[str, str]:
    """Return measurements of three targets in the formats of four devices."""
    rows = [line.split(",") for line in (folder / "timed.csv").read_text().split()]
    rows = [row for row in rows if len(row) > 4 and row[0] in VECTORS]
    leica = ["X  [mm],Y  [mm],Z  [mm],U(95)  [mm],Target,Temperature  [\xb0C],"
             "Time Stamp,OTG Applied"]  # fmt: skip
    faro = ["FARO CAM2 2023", "Units: Millimeters", "", "Name\tX\tY\tZ\tDeviation"]
    german = ["Point;X [mm];Y [mm];Z [mm];Date;Time"]
    wide = [",".join(f"{name}_{axis} [mm]" for name in VECTORS for axis in "xyz")]
    cells: list[str] = []
    for k, (name, x, y, z, *_) in enumerate(rows):
        point = f"p{k // len(VECTORS)}::{name}"
        clock = f"10:{k // len(VECTORS):02d}:{2 + k % len(VECTORS):02d}"
        leica.append(f"{x},{y},{z},0.01,{name},22.8,'22.11.2026 {clock},FALSE")
        faro.append(f"{point}\t{x}\t{y}\t{z}\t0.0021")
        numbers = ";".join(value.replace(".", ",") for value in (x, y, z))
        german.append(f"{point};{numbers};22.11.2026;{clock}")
        cells += [x, y, z]
    width = 3 * len(VECTORS)
    wide += [",".join(cells[i : i + width]) for i in range(0, len(cells), width)]
    tables = {"leica.csv": leica, "faro.txt": faro, "german.csv": german,
              "wide.csv": wide}  # fmt: skip
    return {name: "\n".join(lines) + "\n" for name, lines in tables.items()}


def _surfaces() -> dict[str, str]:
    """Return a tetrahedron in several formats, by file name."""
    lines = [line.split() for line in OBJECT.split("\n") if line]
    points = [" ".join(words[1:]) for words in lines if words[0] == "v"]
    faces = [[int(i) - 1 for i in w[1:]] for w in lines if w[0] == "f"]
    head = "ply\nformat ascii 1.0\nelement vertex 4\n" + "".join(
        f"property float {axis}\n" for axis in "xyz"
    )
    ply = [head + "element face 4\nproperty list uchar int vertex_indices\nend_header"]
    ply += points + [f"3 {a} {b} {c}" for a, b, c in faces]
    stl = ["solid s"]
    vtk = ["# vtk DataFile Version 3.0\ns\nASCII\nDATASET POLYDATA\nPOINTS 4 float"]
    vtk += [*points, "POLYGONS 4 16", *(f"3 {a} {b} {c}" for a, b, c in faces)]
    msh = ["$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n4"]
    msh += [f"{k + 1} {point}" for k, point in enumerate(points)]
    msh += ["$EndNodes\n$Elements\n4"]
    for k, (a, b, c) in enumerate(faces):
        corners = "".join(f"vertex {points[i]}\n" for i in (a, b, c))
        stl += [f"facet normal 0 0 0\nouter loop\n{corners}endloop\nendfacet"]
        msh += [f"{k + 1} 2 2 1 1 {a + 1} {b + 1} {c + 1}"]
    tables = {"solid.ply": ply, "solidtext.stl": [*stl, "endsolid s"], "solid.vtk": vtk,
              "solid.msh": [*msh, "$EndElements"]}  # fmt: skip
    return {name: "\n".join(text) + "\n" for name, text in tables.items()}


def _write_step(path: Path) -> None:
    """Write a STEP file with two boxes."""
    import gmsh

    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
        gmsh.model.occ.addBox(0, 0, 1, 1, 1, 2)
        gmsh.model.occ.synchronize()
        gmsh.write(str(path))
    finally:
        gmsh.finalize()
