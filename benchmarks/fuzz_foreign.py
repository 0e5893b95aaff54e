"""Valid files of other programs, and commands that read them.

They are used by ``fuzz.py --foreign``.  Commands of forcefit write robots and matrices,
and this module writes the exports of measuring devices.
"""

from pathlib import Path

OVERLAY = """[[frame]]
name = "*.elbow"
clearance = { radial = 2e-5, axial = 2e-5, tilt = 5e-4 }
"""
SDF = """<sdf version="1.9"><model name="bar">
<link name="crank"><inertial><mass>0.5</mass></inertial></link>
<link name="coupler"><pose>0.1 0 0 0 0 0</pose></link>
<link name="rocker"><pose relative_to="coupler">0.3 0 0 0 0 0</pose></link>
<joint name="drive" type="revolute"><parent>world</parent><child>crank</child>
 <axis><xyz>0 0 1</xyz></axis></joint>
<joint name="pin_a" type="revolute"><parent>crank</parent><child>coupler</child>
 <axis><xyz expressed_in="__model__">0 0 1</xyz></axis></joint>
<joint name="pin_b" type="revolute"><parent>coupler</parent><child>rocker</child>
 <axis><xyz>0 0 1</xyz></axis></joint>
<joint name="pin_c" type="revolute"><pose relative_to="__model__">0.3 0 0 0 0 0</pose>
 <parent>rocker</parent><child>world</child><axis><xyz>0 0 1</xyz></axis></joint>
</model></sdf>
"""
TIED_SDF = """<sdf version="1.6"><world name="w"><frame name="spot">
<pose>0 0 1 0 0 0</pose></frame><model name="m" placement_frame="grip">
<pose relative_to="spot" degrees="true">0 0 0 0 0 90</pose>
<frame name="grip" attached_to="base"><pose>0 0 0.1 0 0 0</pose></frame>
<link name="base"/><link name="arm"><pose frame="grip">0.1 0 0 0 0 0</pose>
<inertial auto="true"/><collision name="c"><geometry><cylinder><radius>0.1</radius>
<length>0.3</length></cylinder></geometry></collision></link>
<model name="hand"><pose>0.2 0 0 0 0 0</pose><link name="palm"/></model>
<joint name="a" type="universal"><parent>grip</parent><child>arm</child>
<axis><xyz>0 0 1</xyz><use_parent_model_frame>1</use_parent_model_frame></axis></joint>
<joint name="b" type="prismatic"><parent>arm</parent><child>hand::palm</child>
<axis><xyz>1 0 0</xyz><mimic joint="a" axis="axis2"><multiplier>2</multiplier></mimic>
<dynamics><spring_stiffness>5</spring_stiffness></dynamics></axis></joint>
<plugin name="p"><joint>a</joint><joint>b</joint></plugin></model></world></sdf>
"""
TIED_MJCF = """<mujoco><compiler settotalmass="9" angle="radian" eulerseq="XyZ"/>
<default><joint axis="0 1 0"/><default class="s"><joint type="slide"/></default>
</default><asset><model name="kid" file="kid.xml"/></asset>
<worldbody><body name="p" pos="0 0 1"><freejoint/><geom size="0.1"/>
<site name="s" type="capsule" size="0.01" fromto="0 0 0 0.1 0 0"/></body>
<replicate count="3" euler="0 0 2.1"><frame pos="1 0 0"><body name="leg">
<joint name="q" stiffness="5"/><geom type="box" size="0.1 0.1 0.2"/><body name="rod">
<joint name="d" class="s"/><geom type="capsule" fromto="0 0 0 0 0 1" size="0.1"/>
</body></body></frame></replicate>
<frame pos="0 0 3"><attach model="kid" prefix="k_"/></frame></worldbody>
<equality><connect body1="rod0" body2="p" anchor="0 0 1"/>
<weld body1="rod1" body2="p" relpose="0 0 0 1 0 0 0" anchor="0 0 1" torquescale="0"/>
<joint joint1="d2" joint2="d1" polycoef="0 1 0.5"/></equality>
<tendon><fixed name="t"><joint joint="d0" coef="1"/></fixed></tendon>
<actuator><motor joint="d1"/><motor tendon="t"/></actuator>
<keyframe><key name="home" qpos="0 0 1 1 0 0 0 0 0 0 0 0 0 0"/></keyframe></mujoco>
"""
KID = """<mujoco><worldbody><body name="b" euler="30 0 0"><joint name="j"/>
<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></worldbody></mujoco>
"""
TIED_URDF = """

<?xml version="1.0"?>
<robot name="r" xmlns="urn:any"><link name="base"/><link name="a"/><link name="b"/>
<link name="c"/><!-- a -- b -->
<joint name="base" type="continuous"><parent link="base"/><child link="a"/>
<axis xyz="0 0 1"/></joint>
<joint name="q" type="continuous"><parent link="a"/><child link="b"/>
<origin xyz="0 0.2 0" quat_xyzw="0 0 0 1"/><axis xyz="0 0 1"/></joint>
<joint name="r" type="continuous"><parent link="base"/><child link="c"/>
<origin xyz="0.4 0 0"/><axis xyz="0 0 1"/>
<mimic joint="base" multiplier="1"/></joint>
<loop_joint name="l" type="continuous"><link1 link="b" xyz="0.4 0 0"/>
<link2 link="c" xyz="0 0.2 0"/><axis xyz="0 0 1"/></loop_joint>
<gazebo><joint name="g" type="ball"><pose>0 0.2 0 0 0 0</pose><parent>b</parent>
<child>c</child></joint></gazebo></robot>
"""
DMIG = """DMIG,KAAX,0,6,2,0
DMIG,KAAX,7,1,,7,1,8.4+7,
DMIG,KAAX,7,2,,7,2,1.344E+05,,7,6,-3.36E+04,
DMIG KAAX 7 3 7 3 3.024E5 7 5 7.56E4
DMIG KAAX 7 4 7 4 646.0
DMIG,KAAX,7,5,,7,5,2.52E+04,,,+
DMIG*   KAAX                           7               6
*                      7               6 1.120000000D+04
DMIG,K4AAX,0,6,2,0
DMIG,K4AAX,7,1,,7,1,1.6+6
"""
TARGETS = """robot = "arm.toml"
unit = "mm"
noise = 1e-5
dates = "day_first"
[targets]
A = [0.0, 0.0, 0.1]
B = [0.1, 0.02, 0.0]
C = [0.0, 0.07, 0.03]
"""
NODES = "1,0,0,0\n2,0.3,0,0\n"

# probability weight and arguments of each command
FOREIGN = [
    (6, "convert five.urdf -o new.toml"),
    (3, "convert five.urdf --loops loops.yaml --overlay overlay.toml -o new.toml"),
    (5, "convert five.xml -o new.toml"),
    (5, "convert bar.sdf -o new.toml"),
    (6, "convert tied.sdf -o new.toml"),
    (8, "convert tied.xml -o new.toml"),
    (6, "convert tied.urdf -o new.toml"),
    (3, "assembly solve tied.urdf --quantities margin --json -"),
    (4, "stiffness convert long.dmig --json -"),
    (2, "convert five.toml -o new.urdf"),
    (2, "convert five.toml -o new.xml"),
    (4, "stiffness convert rod.mtx --json new.json"),
    (3, "stiffness convert rod.mtx --nodes nodes.csv --base 1 --tip 2 --json -"),
    (4, "stiffness convert element.mtx --unit mm --json -"),
    (4, "stiffness convert rod.pch --json new.json"),
    (4, "stiffness convert rod.npy --json -"),
    (4, "stiffness convert rod.json --to nastran -o new.pch"),
    (6, "validation import named.txt --targets smr.toml --commands commands.csv "
        "-o newfolder"),
    (4, "validation import timed.csv --targets smr.toml --commands commands.csv "
        "-o newfolder --json new.json"),
    (3, "report compare rod.json other.json --report new.html"),
]  # fmt: skip

MADE_FOREIGN = [
    "convert five_bar -o five.urdf", "convert five_bar -o five.xml",
    "convert five_bar -o five.toml",
    "stiffness beam --length 0.3 --young 7e10 --poisson 0.3 --radius 0.02 "
    "--json rod.json",
    "stiffness beam --length 0.3 --young 7e10 --poisson 0.3 --radius 0.03 "
    "--json other.json",
    "stiffness convert rod.json --to matrix-market -o rod.mtx",
    "stiffness convert rod.json --to abaqus --unit mm -o element.mtx",
    "stiffness convert rod.json --to nastran -o rod.pch",
    "stiffness convert rod.json --to numpy -o rod.npy",
]  # fmt: skip


def write_foreign(folder: Path) -> None:
    """Write all files that are not written by commands.

    Args:
        folder: folder that contains the robot ``arm.toml``.
    """
    from forcefit.assembly.files.robot_file import read_robot
    from forcefit.assembly.kinematics.posture import place_robot

    robot = read_robot(folder / "arm.toml")
    drives = [frame.name for frame in robot.frames if frame.actuated]
    platform = robot.index(robot.platform)
    points = {"A": (0, 0, 0.1), "B": (0.1, 0.02, 0), "C": (0, 0.07, 0.03)}
    commands = ["id," + ",".join(f"q.{name}" for name in drives) + ",time"]
    named, timed = [], ["name,x [mm],y [mm],z [mm],U95 [um],timestamp"]
    for k in range(6):
        angles = [0.2 + 0.15 * k + 0.1 * j for j in range(len(drives))]
        cells = ",".join(f"{angle:.3f}" for angle in angles)
        commands.append(f"p{k},{cells},2026-11-22T10:{k:02d}:00")
        at = place_robot(robot, joints=dict(zip(drives, angles, strict=True)))
        for name, point in points.items():
            x, y, z = 1e3 * (at.transforms[platform] @ [*point, 1.0])[:3]
            named.append(f"Main::p{k}::{name}, {x:.4f}, {y:.4f}, {z:.4f}")
            timed.append(f"{name},{x:.4f},{y:.4f},{z:.4f},20,2026-11-22T10:{k:02d}:02")
    texts = {
        "overlay.toml": OVERLAY, "bar.sdf": SDF,
        "tied.sdf": TIED_SDF, "tied.xml": TIED_MJCF, "kid.xml": KID,
        "tied.urdf": TIED_URDF, "long.dmig": DMIG, "smr.toml": TARGETS,
        "nodes.csv": NODES, "loops.yaml": "closed_loop: []\nname_mot: []\n",
    }  # fmt: skip
    lines = {"commands.csv": commands, "named.txt": named, "timed.csv": timed}
    texts |= {name: "\n".join(some) + "\n" for name, some in lines.items()}
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")
