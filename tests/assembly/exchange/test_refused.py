"""Error messages for invalid files from other programs."""

import pytest

from tests.assembly.exchange.test_sdf import four_bar
from tests.assembly.exchange.test_sdf_frames import ARM
from tests.assembly.exchange.test_sdf_frames import joint as sdf_joint
from tests.assembly.exchange.test_urdf import Z, follower
from tests.assembly.exchange.test_urdf import joint as urdf_joint


def urdf(kind="revolute", child="b", more="", links=""):
    """Return a URDF with two links and a joint, which may be invalid."""
    return (
        f'<robot name="r"><link name="a"/><link name="b"/>{links}<joint name="j" '
        f'type="{kind}"><parent link="a"/><child link="{child}"/>{more}</joint></robot>'
    )


def urdf_with(text):
    """Return a URDF with the links a, b and c and a joint between a and b."""
    links = "".join(f'<link name="{name}"/>' for name in "abc")
    return f'<robot name="r">{links}{urdf_joint("j", "a", "b", Z)}{text}</robot>'


def mjcf(text):
    """Return an MJCF file, with ``[M]`` replaced by an ``inertial`` element."""
    mass = '<inertial pos="0.1 0 0.05" mass="1" diaginertia="0.01 0.01 0.01"/>'
    return f"<mujoco>{text.replace('[M]', mass)}</mujoco>"


def sdf(text):
    """Return an SDF file with a fixed base and additional elements."""
    return f'<sdf version="1.9"><model name="m">{ARM}{text}</model></sdf>'


K = urdf_joint("k", "b", "c", Z)
TIE = '<constraint type="rod"><from body="a"/><to body="c"/></constraint>'
BUSHING = (
    "<drake:linear_bushing_rpy><drake:bushing_frameA name='{}'/>"
    "<drake:bushing_frameC name='{}'/></drake:linear_bushing_rpy>"
)
TWO = (
    '<worldbody><body name="a">[M]<joint name="j"/></body><body name="b">[M]'
    '<freejoint name="f"/></body></worldbody><equality>{}</equality>'
)
A = '<link name="a"/>' + sdf_joint("j", "base", "a")


REFUSED = {
    ("urdf", "a type of joint"): (urdf(kind="revolut"),
        "joint \"j\".type: found 'revolut', expected revolute | continuous | "
        "prismatic | fixed | spherical | ball | universal | planar | floating; did "
        'you mean "revolute"?'),
    ("urdf", "an angle that a macro computes"): (
        urdf(more='<origin rpy="${pi/2} 0 0"/>'),
        "joint \"j\".origin.rpy: found '${pi/2} 0 0', expected 3 finite numbers [rad]"),
    ("urdf", "an axis without a direction"): (
        urdf(more='<axis xyz="0 0 0"/>'),
        'joint "j".axis.xyz: found [0.0, 0.0, 0.0], expected a nonzero vector'),
    ("sdf", "a pose of five numbers"): (
        sdf('<link name="a"><pose>0 0 0 0 0</pose></link>'
            + sdf_joint("j", "base", "a")),
        "link \"a\".pose: found '0 0 0 0 0', expected 6 finite numbers"),
    ("sdf", "a version of which the rules are unknown"): (
        sdf("").replace("1.9", "1.3"),
        'sdf.version: found "1.3", expected 1.4 or a later version 1.x'),
    ("urdf", "an unknown link"): (urdf(child="c"),
        'joint "j": found "c", expected the name of a link; valid: a, b'),
    ("urdf", "a ring of parents"): (urdf(child="a"),
        'joint "j": found a cycle of parents, expected parents that lead '),
    ("urdf", "two roots"): (urdf(links='<link name="c"/>'),
        'found as root link "a" and "c", expected exactly one link'),
    ("urdf", "a link twice"): (urdf(links='<link name="b"/>'),
        'link "b".name: found this name twice; expected unique names'),
    ("urdf", "two numbers for three"): (urdf(more='<origin xyz="0 0"/>'),
        "joint \"j\".origin.xyz: found '0 0', expected 3 finite numbers [m]"),
    ("urdf", "nan"): (urdf(more='<origin xyz="0 0 nan"/>'),
        "joint \"j\".origin.xyz: found '0 0 nan', expected 3 finite numbers [m]"),
    ("urdf", "an unknown leader"): (urdf(more='<mimic joint="k"/>'),
        'joint "j".mimic.joint: found "k", expected a joint with one degree'),
    ("urdf", "a joint that follows itself"): (
        urdf_with(follower("k", "b", "c", "k", 1, 0)),
        'joint "k": found a cycle of couplings in which it follows itself ("k")'),
    ("urdf", "joints that follow each other"): (
        urdf_with(follower("k", "b", "c", "l", 1, 0) + '<link name="d"/>'
                  + follower("l", "b", "d", "k", 1, 0)),
        'joint "k": found a cycle of couplings in which it follows itself '
        '("k" -> "l"), expected it to follow another joint'),
    ("urdf", "a link without a name"): ("<robot><link/></robot>",
        "link.name: missing; expected a text"),
    ("urdf", "no link"): ("<robot/>",
        "link: missing; expected at least one link"),
    ("urdf", "another element"): ("<robott/>",
        'found the root element "robott", expected robot'),
    ("urdf", "half a file"): ("<robot>",
        "not valid XML: no element found"),
    ("urdf", "an entity"): (
        '<!DOCTYPE r [<!ENTITY x SYSTEM "file:///etc/passwd">]><robot>&x;</robot>',
        "not valid XML: found a document type or an entity, which could load other "
        "files; expected neither; remove them"),
    ("urdf", "elements in elements"): (f"<robot>{'<a>' * 300}{'</a>' * 300}</robot>",
        "found elements nested more than 200 deep"),
    ("urdf", "a macro"): (urdf_with('<xacro:macro name="m"/>' + K),
        'xacro:macro "m": found a macro, expected a URDF without macros'),
    ("urdf", "a constraint in gazebo"): (urdf_with(f"{K}<gazebo>{TIE}</gazebo>"),
        'constraint: found an element that may connect "a" and "c" and cannot be '
        "converted, expected a joint or a loop; declare a joint or a loop"),
    ("urdf", "a gearbox in gazebo"): (
        urdf_with(K + '<gazebo><joint name="l" type="gearbox"><parent>a</parent>'
                  "<child>c</child></joint></gazebo>"),
        "joint \"l\".type: found 'gearbox', expected fixed | revolute | continuous | "
        "prismatic | ball | universal | revolute2 | screw"),
    ("urdf", "a screw of drake"): (
        urdf_with(urdf_joint("k", "b", "c", "", "screw", "drake:joint")),
        "drake:joint \"k\".type: found 'screw', expected ball | universal | planar"),
    ("urdf", "a loop of one link"): (
        urdf_with(K + '<loop_joint name="l" type="spherical"><link1 link="c"/>'
                  '<link2 link="c"/></loop_joint>'),
        'loop_joint "l".link2: found "c" twice, expected another link'),
    ("yaml", "a loop of one name"): ("closed_loop: [[b]]",
        "closed_loop[1]: found ['b'], expected two different names"),
    ("yaml", "a loop of an unknown name"): ("closed_loop: [[b, bb]]",
        'closed_loop[1]: found "bb", expected a joint or link of the robot; did you '
        'mean "b"?'),
    ("yaml", "a loop of a joint and its link"): ("closed_loop: [[j, b]]",
        'closed_loop[1]: found "j" and "b", both on the link "b"; expected two '
        "different links"),
    ("yaml", "a type of loop"): ("closed_loop: [[a, b]]\ntype: [5d]",
        "type: found '5d', expected \"6d\" or \"3d\""),
    ("yaml", "no type"): ("closed_loop: [[a, b]]\ntype: []",
        "type: found 0, expected one for each of 1 loops"),
    ("yaml", "a misspelt key"): ("closed_lop: []",
        'closed_loop: missing; expected pairs of names; did you mean "closed_lop"?'),
    ("yaml", "an unknown drive"): ("closed_loop: []\nname_mot: [k]",
        'name_mot: found "k", expected a joint or link of the robot; valid: j'),
    ("yaml", "a word for a home"): ("closed_loop: []\nhome: {j: x}",
        "home.j: found 'x', expected a finite number [rad or m]"),
    ("yaml", "an unknown platform"): ("closed_loop: []\nplatform: k",
        'platform: found "k", expected a joint or link of the robot; valid: a, b, j'),
    ("yaml", "no type of joint"): ("closed_loop: []\njoint_name: [j]",
        "joint_type: found 0, expected one for each of 1 joints"),
    ("yaml", "an unknown type of joint"): (
        "closed_loop: []\njoint_name: [j]\njoint_type: [BALL]",
        "joint_type: found 'BALL'; valid: FIXED, SPHERICAL, UJOINT_XY, UJOINT_XZ, "
        "UJOINT_YX, UJOINT_YZ, UJOINT_ZX, UJOINT_ZY"),
    ("yaml", "half a list"): ("[1\n",
        "not valid YAML: line 2, column 1: expected ',' or ']'"),
    ("yaml", "a list"): ("- 1",
        "found [1], expected keys such as closed_loop"),
    ("yaml", "code"): ("!!python/object/apply:os.getcwd []",
        "not valid YAML: line 1, column 1: could not determine a constructor"),
    ("xml", "soft bodies"): (mjcf("<worldbody><composite/></worldbody>"),
        "composite: found composite, which generates bodies; expected rigid "
        "bodies written out"),
    ("xml", "half a copy"): (mjcf('<worldbody><replicate count="0.5"/></worldbody>'),
        "replicate.count: found 0.5, expected a whole number from 1 to 10000"),
    ("xml", "an unknown model"): (
        mjcf('<worldbody><body name="a">[M]</body><attach model="m"/></worldbody>'),
        'attach.model: found "m", expected the name of a model asset'),
    ("xml", "an unknown frame"): (
        mjcf('<worldbody><frame name="f"/><attach frame="g" prefix="p"/></worldbody>'),
        'attach.frame: found "g", expected the name of a frame of the attached'),
    ("xml", "a weld of one body"): (mjcf(TWO.format('<weld body1="a" body2="a"/>')),
        'weld: found "a" twice, expected two bodies'),
    ("xml", "a joint that follows itself"): (
        mjcf(TWO.format('<joint joint1="j" joint2="j"/>')),
        'joint "j": found a cycle of couplings in which it follows itself ("j")'),
    ("xml", "a flexible body"): (mjcf(TWO.format('<flex flex="c"/>')),
        "flex: found flex, which generates bodies; expected rigid "
        "bodies written out"),
    ("xml", "a place given twice"): (
        mjcf('<worldbody><site name="s" pos="0 0 0" fromto="0 0 0 1 0 0"/>'
             "</worldbody>"),
        'site "s".fromto: found equal points, or pos together with fromto'),
    ("sdf", "an unknown link"): (
        four_bar().replace("<child>coupler</child>", "<child>couple</child>"),
        'joint "pin_a".child: found "couple", expected a link or frame; did you '
        'mean "coupler"?'),
    ("sdf", "a ring of frames"): (
        four_bar().replace('attached_to="coupler"', 'attached_to="tool"'),
        'frame "tool".pose: found a cycle of relative_to'),
    ("sdf", "a word for a mass"): (
        four_bar().replace("<mass>0.5</mass>", "<mass>x</mass>"),
        "link \"crank\".inertial.mass: found 'x', expected 1 finite number [kg]"),
    ("sdf", "an include of nothing"): (sdf("<include/>"),
        "include.uri: missing; expected the name of a link"),
    ("sdf", "an include of no file"): (sdf("<include><uri>model://x</uri></include>"),
        'include.uri: found "model://x", expected a file or folder next to this'),
    ("sdf", "a link twice"): (sdf('<link name="base"/>'),
        'link "base".name: found this name twice; expected unique names'),
    ("sdf", "two models"): (four_bar().replace("</model>", '</model><model name="b"/>'),
        "found 2 models, expected exactly one"),
    ("sdf", "an axis of zero"): (
        four_bar().replace("<xyz>0 0 1</xyz>", "<xyz>0 0 0</xyz>"),
        "joint \"drive\".axis.xyz: found [0.0, 0.0, 0.0], expected a nonzero vector"),
    ("sdf", "a joint to its own parent"): (
        sdf('<frame name="f" attached_to="base"/>' + sdf_joint("j", "f", "base")),
        'joint "j".child: found "base", which is also its parent; expected a '
        "different link"),
    ("sdf", "a bushing"): (sdf(A + BUSHING.format("base", "a")),
        'drake:linear_bushing_rpy: found an element that may connect "base" and "a" '
        "and cannot be converted, expected a joint or a loop; declare a joint"),
    ("sdf", "a mesh without a mass"): (
        sdf(A.replace("/>", '><inertial auto="true"/><collision name="c"><geometry>'
                      "<mesh/></geometry></collision></link>", 1)),
        'collision "c".geometry: found mesh, for which forcefit computes no '
        "automatic inertia; expected box | sphere | ellipsoid | cylinder | "
        "capsule | cone, or a mass written in the file"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED, ids=": ".join)
def test_invalid_urdf_mjcf_sdf_and_yaml_files_are_rejected(case, run, tmp_path):
    """An invalid loops file is read together with a valid URDF."""
    ending, (text, message) = case[0], REFUSED[case]
    source = tmp_path / ("robot.urdf" if ending == "yaml" else f"robot.{ending}")
    source.write_text(urdf())
    (tmp_path / f"robot.{ending}").write_text(text)
    status, out, err = run("convert", source, "-o", tmp_path / "out.toml")
    assert (status, out) == (2, "")
    assert f"{tmp_path}/robot.{ending}: {message}" in err.splitlines()[-1]
    assert not (tmp_path / "out.toml").exists()
