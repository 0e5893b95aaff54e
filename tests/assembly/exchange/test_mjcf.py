"""Import of MJCF files, compared with MuJoCo and with hand calculations."""

import json
from dataclasses import replace

import numpy as np
import pytest

from forcefit.assembly.exchange.convert import convert
from forcefit.assembly.exchange.mjcf import read_mjcf
from forcefit.assembly.exchange.mujoco_reading import compare_here as compare
from forcefit.assembly.files.robot_file import read_robot
from forcefit.inputs.errors import BadInput

mujoco = pytest.importorskip("mujoco", reason="MuJoCo is not installed")

M = '<inertial pos="0.1 0 0.05" mass="1" diaginertia="0.01 0.01 0.01"/>'


def file_of(folder, text, name="robot.xml"):
    """Write an MJCF file after replacing ``[M]`` by an ``inertial`` element."""
    path = folder / name
    path.write_text(f"<mujoco>{text.replace('[M]', M)}</mujoco>")
    return path


TWO = """<worldbody><body name="a" pos="0 0 1">[M]<joint name="j"/>
<site name="s" pos="0.1 0.2 0"/></body><body name="b" pos="0 1 1">[M]
<freejoint name="f"/><site name="t" euler="0 0 30"/></body></worldbody>"""
KINDS = {
    "joints in nested frames": """<default><default class="s"><joint type="slide"/>
        </default><joint axis="1 0 0"/></default><worldbody><body name="a">[M]
        <frame euler="90 0 0" pos="0.1 0 0"><joint name="j1" pos="0 0.2 0"/>
        <frame pos="0 1 0" euler="0 30 0" childclass="s"><joint name="j2"/></frame>
        </frame><body name="b" pos="0 0 1">[M]<joint class="s"/></body></body>
        </worldbody>""",
    "frames place bodies, sites and masses": """<worldbody><body name="a"><joint/>
        <frame pos="1 0 0" euler="0 0 90"><inertial pos="0.1 0 0" mass="1"
        diaginertia="1 1 1"/><body name="b"><joint/><geom size="0.1" pos="0.1 0 0"/>
        </body></frame></body></worldbody>""",
    "a free body and a ball": """<worldbody><body name="a" pos="0 0 1"
        euler="10 20 30">[M]<freejoint/><body name="b" pos="1 0 0" euler="9 8 7">[M]
        <joint type="ball" name="k" pos="0 0.1 0"/></body></body></worldbody>""",
    "key of a free body and a ball": """<worldbody><body name="a" pos="0 0 1">[M]
        <freejoint/><body name="b" pos="1 0 0">[M]<joint name="h"/>
        <joint type="ball" pos="0 0.1 0"/></body></body></worldbody><keyframe>
        <key name="home" qpos="1 2 3 0.5 0.5 0.5 0.5 0.3 0.6 0.8 0 0"/></keyframe>""",
    "welds": TWO + """<equality>
        <weld body1="a" body2="b" relpose="0.1 0.2 0.3 0.8 0.6 0 0" anchor="0.5 0 0"/>
        <weld name="w" body1="a" body2="b" anchor="0.5 0 0"/>
        <weld body1="b" body2="a" torquescale="0" anchor="0.2 0 0"/>
        <weld site1="s" site2="t"/><connect body1="b" anchor="0 0 0.3"/>
        <connect site1="t" site2="s"/></equality>""",
    "site by two ends": """<worldbody><body name="a">[M]<joint name="j"/>
        <site name="s" type="capsule" size="0.01" fromto="0.1 0.2 0.3 0.5 -0.2 0.4"/>
        </body><site name="t"/></worldbody><equality><weld site1="s" site2="t"/>
        </equality>""",
    "copies": """<compiler angle="radian" eulerseq="XYZ"/><worldbody>
        <replicate count="2" offset="1 0.5 0" euler="0.1 0.2 0.3"><replicate count="11"
        offset="0 1 0" sep="_"><body name="arm" pos="0.1 0 0"><geom size="0.1"/>
        <joint name="j" axis="0 1 0"/></body></replicate></replicate></worldbody>
        <equality><connect body1="arm_030" body2="arm_101" anchor="0 0 0"/></equality>
        """,
    "parts of the model itself attached": """<default><default class="c"><joint
        axis="1 0 0"/></default></default><worldbody><frame pos="1 0 0" euler="0 0 40">
        <frame name="f" euler="0 20 0"><body name="a" childclass="c">[M]<joint/></body>
        </frame></frame><body name="b">[M]<joint/><frame pos="0 1 0"><attach frame="f"
        prefix="again_"/></frame></body></worldbody>""",
    "a mass of a field, and of a sphere as large as a mesh": """<asset><hfield name="h"
        nrow="2" ncol="2" size="0.8 0.8 0.8 0.3" elevation="1 0 1 1"/><mesh name="m"
        vertex="0 0 0 1 0 0 0 1 0 0 0 1"/></asset><worldbody><body name="a">
        <geom type="hfield" hfield="h"/></body><body name="b"><joint/>
        <geom type="sphere" mesh="m"/></body></worldbody>""",
    "masses of shapes": """<compiler inertiagrouprange="0 2"/><default><geom
        density="500"/></default><worldbody><body name="a"><joint/>
        <geom type="box" size="0.1 0.2 0.3" pos="1 0 0"/><geom size="0.2" group="3"/>
        <geom type="capsule" fromto="0 0 0 0.3 0.4 0" size="0.1"/></body>
        <body name="b"><joint/><geom type="cylinder" size="0.1 0.2"/>
        <geom type="ellipsoid" size="0.1 0.2 0.3" pos="0 1 0"/><geom mass="2"
        size="0.1" pos="0 0 1"/><geom type="box" fromto="0 0 0 0 1 1" size="0.1"/>
        </body><body name="c"><joint/><geom type="capsule" size="0.1 0.2"
        shellinertia="true"/><geom type="ellipsoid" size="0.1 0.2 0.3" pos="0 1 0"
        shellinertia="true"/></body><geom type="plane" size="1 1 1"/></worldbody>""",
    "moments of inertia": """<worldbody><body name="a"><inertial pos="0 0 1" mass="1"
        diaginertia="1 2 2.5" quat="1 2 3 4"/><joint/><body name="b"><inertial
        pos="1 0 0" mass="2" fullinertia="1 2 2.5 0.1 0.2 0.3"/><joint/><frame
        euler="10 20 30"><body name="c"><frame euler="-40 20 10"><inertial pos="0 1 0"
        mass="1" euler="5 6 7" diaginertia="0.1 0.2 0.25"/></frame><joint/></body>
        </frame></body></body></worldbody>""",
    "moments of inertia of shells": """<default><geom shellinertia="true"/></default>
        <worldbody><body name="a"><joint/><geom type="box" size="0.1 0.2 0.3"/></body>
        <body name="b"><joint/><geom type="cylinder" size="0.1 0.2" euler="0 90 0"/>
        <geom size="0.2" mass="3" pos="1 0 0"/></body><body name="c"><joint/><geom
        type="capsule" size="0.1 0.2"/></body></worldbody>""",
    "moments of inertia bounded and balanced": """<compiler boundinertia="0.5"
        balanceinertia="true"/><worldbody><body name="a"><inertial pos="0 0 1"
        mass="1" diaginertia="0.7 0.1 0.4" quat="1 2 3 4"/><joint/></body><body
        name="b"><inertial pos="0 0 1" mass="1" diaginertia="0.7 0.8 2"
        quat="1 2 3 4"/><joint/></body></worldbody>""",
    "masses bounded": """<compiler boundmass="0.5"/><worldbody><body name="a">
        <inertial pos="0 0 1" mass="0.1" diaginertia="1 1 1"/><joint/><body name="b">
        [M]<joint/></body></body></worldbody>""",
    "a mass of shapes beside a written one": """<worldbody><body name="a"><joint/>
        <geom size="0.1"/><body name="b">[M]<joint/></body></body></worldbody>""",
    "masses of shapes before written ones": """<compiler inertiafromgeom="true"/>
        <worldbody><body name="a">[M]<geom size="0.1" pos="1 0 0"/><joint/></body>
        </worldbody>""",
    "masses of a mesh": """<asset><mesh name="m" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/>
        </asset><worldbody><body name="a"><joint/><geom type="mesh" mesh="m"/></body>
        </worldbody>""",
    "every way to place a body": """<compiler angle="degree" eulerseq="XYz"/><default>
        <joint axis="0 1 0"/><default class="slides"><joint type="slide"/></default>
        </default><worldbody><body name="a" pos="0.1 0.2 0.3" euler="10 20 30">[M]
        <joint name="j1" pos="0.05 0 0.02" ref="15"/><joint name="j2" class="slides"
        axis="1 2 0" pos="0 0.1 0"/><body name="b" axisangle="1 1 0 40" pos="0 0.3 0">
        [M]<joint name="j3" axis="1 0 1" pos="-0.1 0 0"/><frame pos="0 0 0.2"
        xyaxes="0 1 0 -1 0 0.2"><body name="c" zaxis="1 0 1" pos="0.1 0 0"
        childclass="slides">[M]<joint name="j4"/><body name="d" quat="1 2 0 1">
        <site name="s" pos="0 0 1"/></body></body></frame></body></body></worldbody>
        <equality><connect name="c" body1="b" anchor="0.1 0.2 0.3"/>
        <weld name="w" body1="d" body2="a"/></equality>""",
    "degrees": """<worldbody><body name="a" axisangle="1 2 3 40">[M]
        <joint name="j" ref="30"/></body></worldbody><keyframe>
        <key name="home" qpos="0.2"/></keyframe>""",
}  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
def test_imported_mjcf_agrees_with_mujoco(kind, tmp_path):
    """Body poses, masses and loop mismatches are compared in random postures."""
    path = file_of(tmp_path, KINDS[kind])
    answer = compare(read_mjcf(path), path)
    assert answer.why_not == ""
    assert answer.difference < 1e-12, answer.text()
    model = mujoco.MjModel.from_xml_path(str(path))
    assert answer.bodies == model.nbody - 1
    assert answer.loops == model.neq


def test_comparison_reports_location_of_largest_difference(tmp_path):
    """A joint axis, mass, moment of inertia or loop is changed."""
    path = file_of(tmp_path, KINDS["welds"])
    right = read_mjcf(path)
    joint = replace(right.joints[0], axis=np.array([0.0, 1.0, 0.0]))
    b = right.bodies["b"]
    heavy = {**right.bodies, "b": replace(b, mass=1.02)}
    wide = {**right.bodies, "b": replace(b, inertia=b.inertia + 1e-6 * np.eye(3))}
    weld = replace(right.loops[1], at_second=np.eye(4))
    for wrong, where in (
        (replace(right, joints=(joint, *right.joints[1:])), "body a"),
        (replace(right, bodies=heavy), "mass of b"),
        (replace(right, bodies=wide), "moments of inertia of b"),
        (replace(right, loops=(right.loops[0], weld)), "loop w"),
    ):
        answer = compare(wrong, path)
        assert not answer.agrees
        assert answer.where == where


def test_attached_mjcf_model_agrees_with_mujoco(tmp_path):
    file_of(tmp_path, """<compiler angle="radian" eulerseq="zyx"/><default>
        <joint axis="1 0 0"/><default class="d"><site pos="1 1 1"/></default></default>
        <worldbody><body name="x" pos="0 0 1" euler="0.5 0 0.1"><geom size="0.1"/>
        <joint name="j"/><site name="s" class="d"/><body name="y" pos="0 1 0">
        <geom size="0.1"/><joint name="k"/></body></body><body name="z">
        <geom size="0.1"/></body></worldbody><equality>
        <weld name="w" body1="y" body2="z"/><connect name="c" body1="y" body2="x"
        anchor="0 0 0"/></equality><actuator><motor name="m" joint="k"/></actuator>
        """, "kid.xml")  # fmt: skip
    path = file_of(tmp_path, """<default><joint axis="0 1 0"/></default>
        <asset><model name="kid" file="kid.xml"/></asset>
        <worldbody><body name="a" pos="1 0 0" euler="0 0 90"><geom size="0.1"/>
        <attach model="kid" body="x" prefix="L_"/></body><frame pos="2 0 0">
        <attach model="kid" prefix="R_"/></frame></worldbody>""")  # fmt: skip
    mechanism = read_mjcf(path)
    answer = compare(mechanism, path)
    assert answer.why_not == ""
    assert answer.difference < 1e-12, answer.text()
    assert {loop.name for loop in mechanism.loops} == {"L_c", "R_w", "R_c"}
    drives = [joint.name for joint in mechanism.joints if joint.actuated]
    assert drives == ["L_k", "R_k"]


def test_copies_of_attached_mjcf_model_have_loops_and_drives(tmp_path):
    file_of(tmp_path, """<worldbody><body name="x" pos="0 0 1"><geom size="0.1"/>
        <joint name="j"/><body name="y" pos="0 1 0"><geom size="0.1"/><joint name="k"/>
        </body></body></worldbody><equality><connect name="c" body1="y" body2="x"
        anchor="0 0 0.1"/></equality><actuator><motor name="m" joint="k"/></actuator>
        """, "kid.xml")  # fmt: skip
    path = file_of(tmp_path, """<default><joint axis="0 1 0"/></default>
        <asset><model name="kid" file="kid.xml"/></asset><worldbody>
        <replicate count="2" offset="1 0 0" sep="-"><attach model="kid" prefix="p_"/>
        </replicate></worldbody>""")  # fmt: skip
    mechanism = read_mjcf(path)
    answer = compare(mechanism, path)
    assert (answer.why_not, answer.bodies, answer.loops) == ("", 4, 2)
    assert answer.difference < 1e-12, answer.text()
    assert [loop.name for loop in mechanism.loops] == ["p_c-0", "p_c-1"]
    drives = [joint.name for joint in mechanism.joints if joint.actuated]
    assert drives == ["p_k-0", "p_k-1"]


def test_mjcf_include_is_read_or_rejected(tmp_path):
    (tmp_path / "parts").mkdir()
    inner = '<mujocoinclude><body name="b" pos="0 1 0"><joint/><geom size="0.1"/>'
    (tmp_path / "parts" / "b.xml").write_text(f"{inner}</body></mujocoinclude>")
    path = file_of(tmp_path, """<worldbody><body name="a">[M]<joint/>
        <include file="parts/b.xml"/></body></worldbody>""")  # fmt: skip
    mechanism = read_mjcf(path)
    assert mechanism.joints[1].parent == "a"
    assert compare(mechanism, path).difference < 1e-12
    file_of(tmp_path, '<worldbody><include file="none.xml"/></worldbody>')
    with pytest.raises(BadInput, match="none.xml: cannot be read"):
        read_mjcf(path)
    file_of(tmp_path, '<worldbody><include file="robot.xml"/></worldbody>')
    with pytest.raises(BadInput, match="found included files nested more than 10 deep"):
        read_mjcf(path)


def test_rotated_free_body_has_one_degree_of_freedom(run, tmp_path):
    """Serial rotations are singular if a loop rotates the body by 90 degrees about y.

    A body that is welded to a prismatic joint has one degree of freedom.
    """
    path = file_of(tmp_path, """<worldbody><body name="p">[M]<freejoint/>
        <site name="s"/></body><body name="l">[M]<joint name="d" type="slide"/>
        <site name="t" pos="0.3 0 1" euler="0 90 0"/></body></worldbody><equality>
        <weld site1="s" site2="t"/></equality><actuator><motor joint="d"/></actuator>
        """)  # fmt: skip
    answer = convert(path, tmp_path / "robot.toml")
    assert answer.open_after < 1e-12
    status, _, _ = run("assembly", "solve", tmp_path / "robot.toml", "--json",
                       tmp_path / "o.json")  # fmt: skip
    assert status == 0
    mobility = json.loads((tmp_path / "o.json").read_text())["mobility"]
    assert (mobility["freedoms"], mobility["overconstraint"]) == (1, 0)


def test_unconstrained_free_joint_is_reported(tmp_path):
    text = """<worldbody><body name="p">[M]<freejoint name="f"/><body name="q">[M]
        <joint/></body></body></worldbody>"""
    answer = convert(file_of(tmp_path, text), tmp_path / "robot.toml")
    assert "free joints without a loop to the ground: 1 (f)" in answer.taken
    assert len([f for f in answer.robot.frames if f.joint != "fixed"]) == 7


def test_mjcf_settotalmass_scales_all_masses(tmp_path):
    """Masses of 1 and 3 kg are scaled to a total of 10 kg."""
    text = """<compiler settotalmass="10"/><worldbody><body name="a">[M]<joint/>
        <body name="b"><inertial pos="0 0 1" mass="3" diaginertia="1 1 1"/><joint/>
        </body></body></worldbody>"""
    bodies = read_mjcf(file_of(tmp_path, text)).bodies
    assert [bodies[name].mass for name in "ab"] == pytest.approx([2.5, 7.5])
    assert [bodies[k].inertia[0, 0] for k in "ab"] == pytest.approx([0.025, 2.5])


def test_forces_in_three_inclined_legs_are_equal(run, tmp_path):
    """A load of 90 N on three legs at 30 degrees is 30 N / cos 30 deg in each leg.

    The platform is a free body to which the legs are connected.
    """
    legs, ties, drives = "", "", ""
    for i in range(3):
        c, s = np.cos(2 * np.pi * i / 3), np.sin(2 * np.pi * i / 3)
        place = f'pos="{c} {s} 0" zaxis="{-c / 2} {-s / 2} {np.sqrt(0.75)}"'
        legs += f"""<body {place}>[M]<joint axis="{-s} {c} 0"/><body name="rod{i}">[M]
            <joint name="s{i}" type="slide"/></body></body>"""
        # each rod is connected to the centre of the platform at a distance of 1 m
        ties += f'<connect body1="rod{i}" body2="p" anchor="0 0 1"/>'
        drives += f'<position joint="s{i}"/>'
    path = file_of(tmp_path, f"""<worldbody><body name="p" pos="0 0 0.8660254">[M]
        <freejoint/></body>{legs}</worldbody><equality>{ties}</equality>
        <actuator>{drives}</actuator>""")  # fmt: skip
    answer = convert(path, tmp_path / "robot.toml")
    assert answer.open_before < 1e-12
    assert answer.comparisons[0].loops == 3
    assert answer.robot.platform == "p"
    answer = tmp_path / "answer.json"
    status, _, _ = run("assembly", "solve", tmp_path / "robot.toml", "--load", "fz=-90",
                       "--json", answer)  # fmt: skip
    assert status == 0
    frames = json.loads(answer.read_text())["frames"]
    forces = [frames[f"s{i}"]["wrench"][5] for i in range(3)]
    assert np.abs(forces) == pytest.approx(3 * [30 / np.cos(np.pi / 6)], rel=1e-6)


def test_coupled_joints_satisfy_their_polynomials_at_home(tmp_path):
    """At a = 0.7: b = 0.1 + 2 (a - 0.2) + 0.5 (a - 0.2)^2 and c = 0.3 + 3 b."""
    path = file_of(tmp_path, """<compiler angle="radian"/><worldbody><body name="A">[M]
        <joint name="a" ref="0.2"/><body name="B">[M]<joint name="b"/><body name="C">
        [M]<joint name="c" ref="0.3"/></body></body></body></worldbody><equality>
        <joint joint1="c" joint2="b" polycoef="0 3"/>
        <joint joint1="b" joint2="a" polycoef="0.1 2 0.5 0 0"/></equality><keyframe>
        <key name="home" qpos="0.7 0 0"/></keyframe>""")  # fmt: skip
    answer = convert(path, tmp_path / "robot.toml")
    robot = read_robot(tmp_path / "robot.toml")
    b = 0.1 + 2 * 0.5 + 0.5 * 0.5**2
    home = [robot.frame(name).position for name in "abc"]
    assert home == pytest.approx([0.7, b, 0.3 + 3 * b], abs=1e-12)
    assert all(robot.frame(name).actuated for name in "bc")
    lines = [line for line in answer.left_out if line.startswith("mimic: ")]
    assert lines[0].startswith("mimic: b = 0.1 + 2 * x^1 + 0.5 * x^2, x = a - 0.2 be")


def test_driven_joint_of_a_coupled_pair_is_the_leader(tmp_path):
    """The MJCF constraint is inverted, because its follower is driven."""
    path = file_of(tmp_path, """<compiler angle="radian"/><worldbody><body name="A">[M]
        <joint name="a"/><body name="B">[M]<joint name="b"/></body></body></worldbody>
        <equality><joint joint1="b" joint2="a" polycoef="0.1 2 0 0 0"/></equality>
        <actuator><motor joint="b"/></actuator><keyframe><key name="home"
        qpos="0 0.5"/></keyframe>""")  # fmt: skip
    convert(path, tmp_path / "robot.toml")
    robot = read_robot(tmp_path / "robot.toml")
    assert robot.frame("b").position == 0.5
    assert robot.frame("a").position == pytest.approx(0.2, abs=1e-12)


def test_tendons_and_their_actuators_are_reported_as_omitted(run, tmp_path):
    path = file_of(tmp_path, TWO + """<tendon><spatial name="cable"><site site="s"/>
        <site site="t"/></spatial></tendon><actuator><motor tendon="cable"/><motor
        joint="j"/></actuator><equality><tendon tendon1="cable"/><connect name="off"
        active="false" body1="b" anchor="0 0 0"/></equality>""")  # fmt: skip
    status, out, _ = run("convert", path, "-o", tmp_path / "out.toml")
    assert status == 0
    loaded = "not converted, though it may carry load: 1"
    assert f"left out: tendon, {loaded} (spatial cable)" in out
    assert f"left out: actuator of a tendon, {loaded} (cable)" in out
    assert f"left out: equality tendon, {loaded} (cable)" in out
    assert "left out: equality connect, not active: 1 (off)" in out
