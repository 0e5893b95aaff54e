"""Comparison of the robots that MuJoCo and forcefit read from the same file.

The poses of bodies and the mismatch of constraints are compared in random postures.
"""

import pickle
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from warnings import catch_warnings, simplefilter

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.exchange.comparison import POSTURES, Comparison
from forcefit.assembly.exchange.mechanism import Mechanism, body_poses
from forcefit.assembly.exchange.orientation import to_quaternion
from forcefit.assembly.exchange.xml_file import read_xml
from forcefit.assembly.model.inertia import inertia_matrix
from forcefit.inputs.errors import one_line
from forcefit.stiffness.screws import rotation_vector

# [kg] largest mass that MuJoCo assigns to a massless body
_LIGHTEST = 1.01e-6
# [kg m^2] smallest compared principal moment; MuJoCo may increase smaller ones to 1e-9
_LEAST_MOMENT = 1e-8
_ROUNDING = 2e-12  # [kg m^2] accuracy of the principal moments of MuJoCo
_KEYS = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
_UNIT_INERTIA = dict(zip(_KEYS, ("1", "1", "1", "0", "0", "0"), strict=True))
_DRAWN = {"visual", "collision", "gazebo", "transmission", "loop_joint"}


def compare_here(mechanism: Mechanism, path: Path) -> Comparison:
    """Compare a mechanism with the robot that MuJoCo reads from its file.

    Args:
        mechanism: mechanism that was read from or written to the file.
        path: path of a URDF or MJCF file.

    Returns:
        The comparison.  If none was possible, it contains the reason.
    """
    import mujoco

    reader = f"MuJoCo {mujoco.__version__}"
    # by default, MuJoCo writes warnings to a log file
    mujoco.set_mju_user_warning(lambda _: None)
    try:
        with catch_warnings():
            simplefilter("ignore")
            model, whole = _model(mujoco, path)
        return _compared(mujoco, model, mechanism, Comparison(reader, path.name), whole)
    except Exception as error:  # MuJoCo raises C++ exceptions of various types
        words = one_line(" ".join(str(error).split()), 160)
        return Comparison(reader, path.name, f"{reader} cannot read it ({words})")


def main() -> None:
    """Read the arguments of a comparison from a file and write its result."""
    given, made = Path(sys.argv[1]), Path(sys.argv[2])
    with given.open("rb") as file:
        mechanism, path = pickle.load(file)
    answer = compare_here(mechanism, path)
    with made.open("wb") as file:
        pickle.dump(answer, file)


def _model(mujoco: Any, path: Path) -> tuple[Any, bool]:
    """Return the compiled model, and whether its meshes were found."""
    if path.suffix.lower() == ".urdf":
        return _settled(mujoco, mujoco.MjSpec.from_string(_bare_urdf(path))), True
    try:
        return _settled(mujoco, mujoco.MjSpec.from_file(str(path))), True
    except ValueError:
        spec = mujoco.MjSpec.from_file(str(path))
        drawn = [g for g in spec.geoms if g.meshname or g.hfieldname]
        parts = (drawn, spec.skins, spec.meshes, spec.hfields)
        for part in [one for several in parts for one in several]:
            spec.delete(part)
        for geom in spec.geoms:
            geom.material = ""
        for part in [*spec.materials, *spec.textures]:
            spec.delete(part)
        return _settled(mujoco, spec), False


def _settled(mujoco: Any, spec: Any) -> Any:
    """Compile a model with unchanged body frames, permitting massless bodies."""
    compiler = spec.compiler
    compiler.fusestatic = compiler.alignfree = 0
    for joint in spec.joints:
        joint.align = mujoco.mjtAlignFree.mjALIGNFREE_FALSE
    compiler.balanceinertia = 1
    compiler.boundmass = max(compiler.boundmass, 1e-9)
    compiler.boundinertia = max(compiler.boundinertia, 1e-9)
    model = spec.compile()
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    return model


def _bare_urdf(path: Path) -> str:
    """Return the text of a URDF without shapes, because mesh files may be missing."""
    from xml.etree.ElementTree import Element, tostring

    root = read_xml(path, "robot").element
    for element in list(root.iter()):
        if element.tag.endswith(":joint") or element.get("quat_xyzw"):
            raise ValueError(f"its URDF reader does not support {element.tag}")
        if element.tag == "inertia" and not _comparable(_attributes(element.attrib)):
            element.attrib.update(
                _UNIT_INERTIA
            )  # MuJoCo rejects the zero moment of inertia of a thin rod
        for inner in list(element):
            if inner.tag in _DRAWN or ":" in inner.tag:
                element.remove(inner)
    for key in [key for key in root.attrib if ":" in key or key == "xmlns"]:
        del root.attrib[key]
    for inertial in root.iter("inertial"):
        if inertial.find("mass") is not None and inertial.find("inertia") is None:
            inertial.append(Element("inertia", _UNIT_INERTIA))
    root.append(Element("mujoco"))
    return tostring(root, encoding="unicode")


def _compared(
    mujoco: Any, model: Any, mechanism: Mechanism, start: Comparison, whole: bool
) -> Comparison:
    """Compare a MuJoCo model with a mechanism in random postures."""
    bodies = _body_names(model)
    strange = [name for name in bodies[1:] if name not in mechanism.bodies]
    unread = {} if not strange else {f"body {strange[0]}, which was not read,": np.inf}
    unweighed = set(mechanism.unweighed)
    known = [
        i for i, name in enumerate(bodies)
        if i and name in mechanism.bodies and whole and name not in unweighed
    ]  # fmt: skip
    weighed = [(i, bodies[i]) for i in known]
    gaps = unread | _mass_gaps(model, mechanism, weighed)
    gaps |= _inertia_gaps(mujoco, model, mechanism, weighed)
    rules = _rules(mujoco, model)
    loops = [loop for loop in mechanism.loops if loop.name in rules]
    random, data = np.random.default_rng(1), mujoco.MjData(model)
    for _ in range(POSTURES):
        q = mechanism.home + random.uniform(-1, 1, len(mechanism.joints))
        poses = _placed(mujoco, model, data, mechanism, q)
        reach = max(1.0, max(np.abs(T[:3, 3]).max() for T in poses.values()))
        for i, name in enumerate(bodies):
            if i and name in poses:
                gap = np.abs(data.xmat[i].reshape(3, 3) - poses[name][:3, :3]).max()
                off = np.abs(data.xpos[i] - poses[name][:3, 3]).max() / reach
                _widen(gaps, f"body {name}", max(gap, off))
        for loop in loops:
            rows = data.efc_pos[_rows(mujoco, data, rules[loop.name][0])]
            A = poses[loop.first] @ loop.at_first
            B = poses[loop.second] @ loop.at_second
            apart = float(np.linalg.norm(A[:3, 3] - B[:3, 3]))
            open_by = abs(apart - float(np.linalg.norm(rows[:3]))) / reach
            if not loop.point:
                angle = np.linalg.norm(rotation_vector(A[:3, :3].T @ B[:3, :3]))
                turned = float(np.linalg.norm(rows[3:6])) / rules[loop.name][1]
                open_by = max(open_by, abs(np.sin(angle / 2) - turned))
            _widen(gaps, f"loop {loop.name}", open_by)
    worst = max(gaps, key=lambda where: gaps[where], default="")
    weights = {
        name: (
            float(model.body_mass[i]), np.array(model.body_ipos[i]),
            _moments(mujoco, model, i),
        )
        for i, name in enumerate(bodies) if whole and name in unweighed
    }  # fmt: skip
    compared = len([name for name in bodies[1:] if name in mechanism.bodies])
    return Comparison(
        start.reader, start.file, "", compared, len(known), len(loops),
        float(gaps.get(worst, 0.0)), worst, weights,
    )  # fmt: skip


def _widen(gaps: dict[str, float], where: str, gap: float) -> None:
    """Update the largest difference of a body or loop."""
    gaps[where] = max(gaps.get(where, 0.0), float(gap))


def _body_names(model: Any) -> list[str]:
    """Return the names of all bodies; bodies without a name are numbered."""
    return [model.body(i).name or f"body{i}" for i in range(model.nbody)]


def _mass_gaps(
    model: Any, mechanism: Mechanism, bodies: list[tuple[int, str]]
) -> dict[str, float]:
    """Return relative differences of masses and distances of centres of mass [m]."""
    gaps: dict[str, float] = {}
    for i, name in bodies:
        body, mass = mechanism.bodies[name], float(model.body_mass[i])
        if body.mass or mass > _LIGHTEST:
            largest = max(mass, body.mass)
            gaps[f"mass of {name}"] = abs(mass - body.mass) / largest
            off = np.abs(model.body_ipos[i] - body.centre).max()
            gaps[f"centre of mass of {name}"] = float(off)
    return gaps


def _inertia_gaps(
    mujoco: Any, model: Any, mechanism: Mechanism, bodies: list[tuple[int, str]]
) -> dict[str, float]:
    """Return the relative differences of inertia matrices."""
    gaps: dict[str, float] = {}
    for i, name in bodies:
        J = mechanism.bodies[name].inertia
        if _comparable(J):
            off = np.abs(_moments(mujoco, model, i) - J).max() - _ROUNDING
            gaps[f"moments of inertia of {name}"] = max(off, 0.0) / np.abs(J).max()
    return gaps


def _moments(mujoco: Any, model: Any, i: int) -> NDArray:
    """Return the inertia matrix of a body, (3, 3) [kg m^2], in body axes."""
    entries = np.zeros(9)
    mujoco.mju_quat2Mat(entries, model.body_iquat[i])
    R = entries.reshape(3, 3)
    return np.asarray(R @ np.diag(model.body_inertia[i]) @ R.T)


def _comparable(J: NDArray) -> bool:
    """Return whether MuJoCo preserves an inertia matrix.

    It changes the moments of thin rods and plates.
    """
    least, middle, most = np.linalg.eigvalsh(J)
    return bool(least > _LEAST_MOMENT and most < (1 - 1e-9) * (least + middle))


def _attributes(six: Mapping[str, str]) -> NDArray:
    """Return the inertia matrix from URDF attributes, (3, 3) [kg m^2]."""
    return inertia_matrix([float(six.get(key, "0")) for key in _KEYS])


def _rules(mujoco: Any, model: Any) -> dict[str, tuple[int, float]]:
    """Return index and torque scale of active connect and weld constraints, by name."""
    kinds = int(mujoco.mjtEq.mjEQ_CONNECT), int(mujoco.mjtEq.mjEQ_WELD)
    active = [i for i in range(model.neq) if model.eq_active0[i]]
    return {
        model.equality(i).name or f"loop{count}": (i, float(model.eq_data[i, 10]))
        for count, i in enumerate(active, 1) if int(model.eq_type[i]) in kinds
    }  # fmt: skip


def _rows(mujoco: Any, data: Any, constraint: int) -> NDArray:
    """Return a mask that selects the residuals of an equality constraint."""
    equal = data.efc_type == int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)
    return np.asarray(equal & (data.efc_id == constraint))


def _placed(
    mujoco: Any, model: Any, data: Any, mechanism: Mechanism, q: NDArray
) -> dict[str, NDArray]:
    """Set the MuJoCo coordinates, and return the poses of the mechanism's bodies."""
    names, kinds = _body_names(model), mujoco.mjtJoint
    row = {j.name: k for k, j in enumerate(mechanism.joints) if j.kind != "fixed"}
    known: set[str] = set()
    several: list[tuple[int, str, bool]] = []
    number = np.zeros(model.nbody, dtype=int)
    data.qpos[:] = model.qpos0
    for i in range(model.njnt):
        body, first = int(model.jnt_bodyid[i]), number[model.jnt_bodyid[i]] == 0
        number[body] += 1
        name = model.joint(i).name or f"{names[body]}.joint{number[body]}"
        if name in row:
            known.add(name)
            data.qpos[model.jnt_qposadr[i]] = q[row[name]]
        elif f"{name}.rx" in row and model.jnt_type[i] in {
            int(kinds.mjJNT_BALL), int(kinds.mjJNT_FREE)
        }:  # fmt: skip
            known |= {f"{name}.{part}" for part in ("tx", "ty", "tz", "rx", "ry", "rz")}
            several.append((i, name, bool(first)))
    # joints that do not exist in MuJoCo have zero coordinates
    held = [joint.name not in known for joint in mechanism.joints]
    poses = body_poses(mechanism, np.where(held, 0.0, q))
    for i, name, first in several:
        at, body = int(model.jnt_qposadr[i]), int(model.jnt_bodyid[i])
        last = mechanism.joints[row[f"{name}.rz"]]
        C = poses[last.child]
        if model.jnt_type[i] == int(kinds.mjJNT_FREE):
            data.qpos[at : at + 3], at = C[:3, 3], at + 3
            turn = C[:3, :3]
        else:
            before = poses[mechanism.joints[row[f"{name}.rx"]].parent][:3, :3]
            own = np.eye(3).ravel()
            if first:
                mujoco.mju_quat2Mat(own, model.body_quat[body])
            turn = (before @ own.reshape(3, 3)).T @ C[:3, :3]
        data.qpos[at : at + 4] = to_quaternion(turn)
    mujoco.mj_fwdPosition(model, data)
    return poses
