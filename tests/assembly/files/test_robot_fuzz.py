"""Whatever is done to a robot file: it works, or one line says why not.

The same hundred cases of each kind in every run; thousands: ``benchmarks/fuzz.py``.
"""

import math
import tomllib
from copy import deepcopy

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from assembly.files.robot_file import read_robot
from assembly.kinematics.posture import home_posture
from forcefit.inputs.table import BadInput
from tests.robot_files_for_tests import FOUR_BAR

ROUND = {"beam": {"radius": 0.01}, "young": 7e10, "poisson": 0.3, "density": 2700.0}
SERIAL = {
    "name": "serial",
    "platform": "tool",
    "frame": [
        {"name": "j1", "parent": "base", "joint": "revolute", "actuated": True,
         "dh": {"theta": 0.1, "d": 0.2, "a": 0.3, "alpha": 1.5}, "mass": 1.2,
         "joint_stiffness": [1e8, 1e8, 1.0, 3.51e8, 3.51e8, 4.39e8]},
        {"name": "j2", "parent": "j1", "joint": "prismatic", "position": 0.1,
         "rotation": [0.1, -0.2, 3.0], "geometric_error": [1e-5, 0, 0, 0, 2e-6, 0],
         "joint_stiffness": [[1e6 * (i == j) for j in range(6)] for i in range(6)]},
        {"name": "tool", "parent": "j2", "translation": [0, 0.1, 0.4], "mass": 2,
         "centre_of_mass": [0, 0, 0.1], "link": ROUND},
    ],
}  # fmt: skip
MESH = {"surface": "meshes/x.stl", "base": "z=0", "tip": "z=0.4", "up": [1, 0, 0]}
BORE = {"bore": {"point": [0, 0, 0.4], "axis": [0, 1, 0], "radius": 0.01}}
STEEL = {"young": 2.1e11, "poisson": 0.3}
BODIES = [
    {"beam": {"radius": 0.02, "inner_radius": 0.01, "theory": "euler"}, **STEEL},
    {"beam": {"width": 0.02, "height": 0.04, "up": [0, 0, 1]}, **STEEL},
    {"beam": {"area": 1e-4, "I_y": 1e-8, "I_z": 2e-8, "J": 3e-8, "shear_y": 0.8,
              "shear_z": 0.9, "length": 0.3, "axis": [1, 0, 0]}, **STEEL},
    {"stiffness": [[1e6 * (i == j) for j in range(6)] for i in range(6)]},
    {"library": "links.nc#upper"},
    {"mesh": MESH | {"tip": BORE}, "up": [0, 0, 1], **STEEL},
]  # fmt: skip
LINKS = {
    "name": "links",
    "platform": "f5",
    "frame": [
        {"name": f"f{i}", "parent": f"f{i - 1}" if i else "base", "link": link,
         "translation": [0.1, 0.2, 0.0]}
        for i, link in enumerate(BODIES)
    ],
}  # fmt: skip
SEEDS = [tomllib.loads(FOUR_BAR), SERIAL, LINKS]


def toml(data):
    """A TOML file of tables; lists of tables at the root become blocks."""
    lines, blocks = [], []
    for key, value in data.items():
        tables = isinstance(value, list) and all(isinstance(v, dict) for v in value)
        if tables and value:
            for table in value:
                blocks += ["", f"[[{written(key)}]]"]
                blocks += [f"{written(k)} = {written(v)}" for k, v in table.items()]
        else:
            lines.append(f"{written(key)} = {written(value)}")
    return "\n".join([*lines, *blocks, ""])


def written(value):
    """A value in TOML, or a key in quotes."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f'"{"".join(map(escaped, value))}"'
    if isinstance(value, list):
        return "[" + ", ".join(map(written, value)) + "]"
    if isinstance(value, dict):
        pairs = (f"{written(k)} = {written(v)}" for k, v in value.items())
        return "{ " + ", ".join(pairs) + " }"
    return repr(value)


LIGHT = settings(
    max_examples=100,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)

odd_values = st.one_of(
    st.sampled_from([
        math.nan, math.inf, -math.inf, -1, -1.0, 0, -0.0, 1e300, -1e300, 1e-300,
        5e-324, 1e7, 10**30, 2**2000, True, False, "", " ", "base", "a", "nan", "1.0",
        "x" * 5000, "line\nbreak", "\x1b[31m", "\u2028", "z=0", "z=nan",
        "bore=0,0,0/0,0,0/1",
        [], [[]], [1], [1, 2], [0, 0, 0], [1e200] * 3, [1e-200] * 3, [0] * 6, [-1] * 6,
        [math.inf] * 6, [math.nan] * 6, [True] * 6, [["a"] * 6] * 6, [[1.0] * 6] * 6,
        [[math.inf if i == j else 0 for i in range(6)] for j in range(6)],
        [[1e300 if i == j else -1e300 for i in range(6)] for j in range(6)],
        {}, {"a": 1}, {"a": {"b": {"c": [[[[[1]]]]]}}}, {"radius": 1e-300}, [{}],
        {"plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}, "radius": 1},
        {"bore": {"point": [1e300] * 3, "axis": [1e200] * 3, "radius": 1e300}},
    ]),
    st.floats(),
    st.integers(),
    st.text(max_size=20),
    st.lists(st.floats(), max_size=7),
)  # fmt: skip


def escaped(c):
    """A character of a string, the odd ones by number."""
    return c if c.isalnum() or c in " ._=,/#-" else f"\\U{ord(c):08x}"


def places(value, path=()):
    """Where something stands in nested tables and lists."""
    yield path
    items = value.items() if isinstance(value, dict) else ()
    items = enumerate(value) if isinstance(value, list) else items
    for key, inner in items:
        yield from places(inner, (*path, key))


def at(data, path):
    for key in path:
        data = data[key]
    return data


@st.composite
def mangled_tables(draw):
    """A robot whose tables were changed in one to three places."""
    data = deepcopy(draw(st.sampled_from(SEEDS)))
    for _ in range(draw(st.integers(1, 3))):
        path = draw(st.sampled_from([p for p in places(data) if p] or [("name",)]))
        holder, key = at(data, path[:-1]), path[-1]
        if not isinstance(holder, dict | list) or (path and not data):
            continue
        change = draw(st.sampled_from(["replace"] * 6 + ["drop", "rename", "repeat"]))
        if change == "replace":
            holder[key] = deepcopy(draw(odd_values))
        elif change == "drop":
            del holder[key]
        elif isinstance(holder, dict):
            holder[
                draw(st.sampled_from([key + "x", "", "base", "a\nb", "y" * 999]))
            ] = holder.pop(key)
        else:
            holder.insert(draw(st.integers(0, len(holder))), deepcopy(holder[key]))
    return data


@st.composite
def mangled_families(draw):
    """A robot whose frames were shuffled, with parents and names exchanged."""
    data = deepcopy(draw(st.sampled_from(SEEDS)))
    frames = data["frame"]
    names = [f["name"] for f in frames] + ["base", "nobody"]
    for _ in range(draw(st.integers(1, 3))):
        frame = draw(st.sampled_from(frames))
        key = draw(st.sampled_from(["parent", "parent", "name", "joint"]))
        kinds = ["fixed", "revolute", "prismatic"]
        frame[key] = draw(st.sampled_from(kinds if key == "joint" else names))
        if frame.get("joint", "fixed") != "fixed":
            frame["position"] = draw(st.floats(-10, 10))
    data["frame"] = draw(st.permutations(frames))
    data["closure"] = [
        {"frames": [draw(st.sampled_from(names)), draw(st.sampled_from(names))]}
        for _ in range(draw(st.integers(0, 3)))
    ] + data.get("closure", [])
    return data


def assert_works_or_says_why(data, path):
    """Read and place; the only way out is one line that names the file."""
    path.write_text(toml(data), encoding="utf-8")
    try:
        home_posture(read_robot(path))
    except BadInput as error:
        text = str(error)
        assert text.startswith(str(path))
        assert text.isprintable() or all(c >= " " for c in text)
        assert len(text) <= 800
        assert ": " in text.removeprefix(str(path))


@LIGHT
@given(data=mangled_tables())
def test_a_robot_with_odd_values_works_or_one_line_says_why(data, tmp_path):
    assert_works_or_says_why(data, tmp_path / "robot.toml")


@LIGHT
@given(data=mangled_families())
def test_a_robot_with_exchanged_parents_works_or_one_line_says_why(data, tmp_path):
    assert_works_or_says_why(data, tmp_path / "robot.toml")


@pytest.mark.parametrize("data", SEEDS, ids=lambda d: d["name"])
def test_the_robots_that_are_mangled_are_sound(data, tmp_path):
    """Otherwise every mutation would stop at the same first mistake."""
    path = tmp_path / "robot.toml"
    path.write_text(toml(data), encoding="utf-8")
    assert tomllib.loads(toml(data)) == data
    assert home_posture(read_robot(path)).mismatch < 1e-9
