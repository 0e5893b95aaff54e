"""Import of joint springs."""

import json

import pytest

from forcefit.assembly.exchange.convert import convert

M = '<inertial pos="0 0 0" mass="1" diaginertia="0.01 0.01 0.01"/>'
MJCF = f"""<mujoco><worldbody><body name="a">{M}<joint name="drive" axis="0 0 1"/>
<body name="b" pos="0.5 0 0">{M}<joint name="spring" {{}}/></body></body></worldbody>
<actuator><motor joint="drive"/></actuator></mujoco>"""
SDF = """<sdf version="1.9"><model name="m"><link name="a"/><link name="b">
<pose>0.5 0 0 0 0 0</pose></link><joint name="drive" type="revolute">
<parent>world</parent><child>a</child><axis><xyz>0 0 1</xyz></axis></joint>
<joint name="spring" type="{}"><parent>a</parent><child>b</child><axis>
<xyz>{}</xyz><dynamics><spring_stiffness>2000</spring_stiffness>{}</dynamics></axis>
</joint></model></sdf>"""
CASES = {
    "slide.xml": (MJCF.format('type="slide" axis="1 0 0" stiffness="2000"'), 3),
    "hinge.xml": (MJCF.format('axis="0 0 1" stiffness="2000" ref="20" springref="20"'),
                  2),
    "slide.sdf": (SDF.format("prismatic", "1 0 0", ""), 3),
    "hinge.sdf": (SDF.format("revolute", "0 0 1", ""), 2),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_deflection_of_imported_spring_is_load_over_stiffness(name, run, tmp_path):
    """The deflection is 10 N / 2000 N/m or 10 N m / 2000 N m/rad."""
    text, component = CASES[name]
    (tmp_path / name).write_text(text)
    loops = tmp_path / "loops.yaml"
    loops.write_text("closed_loop: []\nname_mot: [drive]\n")
    answer = convert(tmp_path / name, tmp_path / "robot.toml", loops=loops)
    assert not any("spring" in line for line in answer.left_out)
    load = "fx=10" if component == 3 else "mz=10"
    status, _, _ = run("assembly", "solve", tmp_path / "robot.toml", "--load", load,
                       "--json", tmp_path / "o.json")  # fmt: skip
    assert status == 0
    screw = json.loads((tmp_path / "o.json").read_text())["platform_screw"]
    assert screw[component] == pytest.approx(10 / 2000, rel=1e-6)


@pytest.mark.parametrize(("text", "line"), [
    (MJCF.format('axis="0 0 1" stiffness="2000" springref="90"'),
     "springs preloaded at home, not converted, though they may carry load: 1 "
     "(spring by -1.57 rad or m)"),
    (MJCF.format('type="ball" stiffness="2000"'),
     "joint stiffness, not converted, though it may carry load: 1 (spring)"),
    (MJCF.format('axis="1 0 0"').replace('name="drive"', 'name="drive" stiffness="5"'),
     "springs parallel to drives: 1 (drive)"),
])  # fmt: skip
def test_import_reports_springs_that_are_not_converted(text, line, tmp_path):
    path = tmp_path / "robot.xml"
    path.write_text(text)
    assert line in convert(path, tmp_path / "robot.toml").left_out
