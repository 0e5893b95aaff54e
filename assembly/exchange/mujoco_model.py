"""Import of a MuJoCo model in memory: ``MjModel`` or ``MjSpec``.

The compiled model is converted to MJCF text, which is then read like a file.

Sources:
    MuJoCo documentation, mjModel.  ``body_pos`` is in the frame of the parent, and
    ``jnt_pos`` is in the frame of the body.  For a ``connect`` constraint, ``eq_data``
    contains the anchors in both bodies.  For a ``weld`` constraint, it contains the
    anchor in body2, the pose in body1 and the torque scale.
"""

from collections.abc import Iterator
from typing import Any
from xml.etree.ElementTree import Element, SubElement, tostring

import numpy as np
from numpy.typing import ArrayLike

from forcefit.inputs.errors import BadInput

_TIES = {"mjEQ_CONNECT": "connect", "mjEQ_WELD": "weld", "mjEQ_JOINT": "joint",
         "mjEQ_TENDON": "tendon"}  # fmt: skip
_KINDS = {"mjJNT_FREE": "free", "mjJNT_BALL": "ball", "mjJNT_SLIDE": "slide",
          "mjJNT_HINGE": "hinge"}  # fmt: skip
_DRIVEN = {"mjTRN_JOINT": "joint", "mjTRN_JOINTINPARENT": "jointinparent",
           "mjTRN_SLIDERCRANK": "cranksite", "mjTRN_TENDON": "tendon",
           "mjTRN_SITE": "site", "mjTRN_BODY": "body"}  # fmt: skip


def is_mujoco(model: object) -> bool:
    """Return whether an object is an ``MjModel`` or ``MjSpec`` of MuJoCo."""
    kind = type(model)
    return kind.__module__.startswith("mujoco") and kind.__name__ in {
        "MjModel", "MjSpec",
    }  # fmt: skip


def mjcf_of_model(model: Any) -> str:
    """Convert a model to the text of an MJCF file.

    Args:
        model: ``mujoco.MjModel``, or ``mujoco.MjSpec``, which is compiled.

    Returns:
        The text, with angles in radians.  Elements without a name are numbered.

    Raises:
        BadInput: the model is invalid or has flexible bodies.
    """
    import mujoco

    if isinstance(model, mujoco.MjSpec):
        try:
            model = model.compile()
        except ValueError as error:
            raise BadInput(f"MjSpec: MuJoCo cannot compile it: {error}") from None
    if model.nflex:
        raise BadInput("MjModel: found a flex (flexible body), expected rigid bodies")
    root = Element("mujoco", model=_model_name(model))
    SubElement(root, "compiler", angle="radian")
    for i, (start, size) in enumerate(
        zip(model.text_adr, model.text_size, strict=True)
    ):
        text = bytes(model.text_data[start : start + size]).decode().rstrip("\0")
        name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_TEXT, i)
        SubElement(SubElement(root, "custom"), "text", name=name, data=text)
    elements = _bodies(mujoco, model, root)
    _ties(mujoco, model, root, elements)
    if model.ntendon:
        tendons = SubElement(root, "tendon")
        for i in range(model.ntendon):
            SubElement(tendons, "fixed", name=_tendon(model, i))
    _drives(mujoco, model, root)
    for i in range(model.nkey):
        key = model.key(i)
        group = SubElement(root, "keyframe")
        SubElement(group, "key", name=key.name, qpos=words(key.qpos))
    return tostring(root, encoding="unicode")


def _model_name(model: Any) -> str:
    """Return the name of a model, which is the first entry of ``names``."""
    name: str = model.names[: model.names.index(b"\0")].decode()
    return name or "mujoco model"


def _bodies(mujoco: Any, model: Any, root: Element) -> list[Element]:
    """Add the bodies with their joints and masses, and return their elements."""
    elements = [SubElement(root, "worldbody")]
    for i in range(1, model.nbody):
        body = model.body(i)
        element = SubElement(
            elements[int(model.body_parentid[i])], "body", name=_body(model, i),
            pos=words(body.pos), quat=words(body.quat),
        )  # fmt: skip
        elements.append(element)
        if body.mass[0]:
            SubElement(
                element, "inertial", pos=words(body.ipos), quat=words(body.iquat),
                mass=words(body.mass), diaginertia=words(body.inertia),
            )  # fmt: skip
        for number, j in enumerate(_joints_of(model, i), 1):
            _add_joint(mujoco, model, element, j, _joint(model, j, number))
    return elements


def _joints_of(model: Any, body: int) -> Iterator[int]:
    """Return the indices of the joints of a body, in order."""
    first = int(model.body_jntadr[body])
    return iter(range(first, first + int(model.body_jntnum[body])))


def _add_joint(mujoco: Any, model: Any, element: Element, j: int, name: str) -> None:
    """Add a joint to its body."""
    kind = _KINDS[mujoco.mjtJoint(int(model.jnt_type[j])).name]
    if kind == "free":
        SubElement(element, "freejoint", name=name)
        return
    given = {"name": name, "type": kind, "pos": words(model.jnt_pos[j])}
    stiffness = float(model.jnt_stiffness[j])
    if kind != "ball":
        at = int(model.jnt_qposadr[j])
        given |= {"axis": words(model.jnt_axis[j]), "ref": words(model.qpos0[at])}
        if model.jnt_limited[j]:
            given |= {"limited": "true", "range": words(model.jnt_range[j])}
        given["springref"] = words(model.qpos_spring[at])
    powers = getattr(model, "jnt_stiffnesspoly", None)
    more = [] if powers is None else np.ravel(powers[j]).tolist()
    if stiffness or any(more):
        given["stiffness"] = words([stiffness, *(more if any(more) else [])])
    SubElement(element, "joint", given)


def _ties(mujoco: Any, model: Any, root: Element, bodies: list[Element]) -> None:
    """Add the equality constraints, with two new sites for each connect or weld."""
    group = SubElement(root, "equality")
    names = np.cumsum(model.eq_active0)  # numbers of constraints without a name
    for i in range(model.neq):
        kind = _TIES.get(mujoco.mjtEq(int(model.eq_type[i])).name)
        if kind is None:
            continue
        ends = int(model.eq_obj1id[i]), int(model.eq_obj2id[i])
        data = model.eq_data[i]
        active = "true" if model.eq_active0[i] else "false"
        tie = SubElement(group, kind, name=model.equality(i).name or f"loop{names[i]}",
                         active=active)  # fmt: skip
        if kind in {"joint", "tendon"}:
            name = _tendon if kind == "tendon" else _any_joint
            for key, end in zip(("1", "2"), ends, strict=True):
                if end >= 0:
                    tie.set(f"{kind}{key}", name(model, end))
            tie.set("polycoef", words(data[:5]))
            continue
        for key, end, pose in zip("12", ends, _places(kind, data), strict=True):
            body = end
            if int(model.eq_objtype[i]) == int(mujoco.mjtObj.mjOBJ_SITE):
                body = int(model.site_bodyid[end])
                pose = model.site_pos[end], model.site_quat[end]
            site = f"{tie.get('name')}.site{key}"
            SubElement(bodies[body], "site", name=site, pos=words(pose[0]),
                       quat=words(pose[1]))  # fmt: skip
            tie.set(f"site{key}", site)
        if kind == "weld":
            tie.set("torquescale", words(data[10]))


def _places(kind: str, data: Any) -> list[tuple[Any, Any]]:
    """Return the position and quaternion of a constraint in each of its bodies."""
    straight = (1.0, 0.0, 0.0, 0.0)
    if kind == "connect":
        return [(data[:3], straight), (data[3:6], straight)]
    return [(data[3:6], data[6:10]), (data[:3], straight)]


def _drives(mujoco: Any, model: Any, root: Element) -> None:
    """Add the actuators with the names of the actuated objects."""
    group = SubElement(root, "actuator")
    for i in range(model.nu):
        kind = _DRIVEN.get(mujoco.mjtTrn(int(model.actuator_trntype[i])).name, "site")
        end = int(model.actuator_trnid[i, 0])
        names = {"tendon": _tendon, "body": _body}
        name = _any_joint if kind.startswith("joint") else names.get(kind, _site)
        given = {"name": model.actuator(i).name or f"actuator{i + 1}"}
        SubElement(group, "general", given | {kind: name(model, end)})


def _body(model: Any, i: int) -> str:
    return str(model.body(i).name or f"body{i}")


def _tendon(model: Any, i: int) -> str:
    return str(model.tendon(i).name or f"tendon{i + 1}")


def _site(model: Any, i: int) -> str:
    return str(model.site(i).name or f"site{i + 1}")


def _joint(model: Any, j: int, number: int) -> str:
    """Return the name of a joint; ``number`` counts the joints of a body from 1."""
    body = _body(model, int(model.jnt_bodyid[j]))
    return str(model.joint(j).name or f"{body}.joint{number}")


def _any_joint(model: Any, j: int) -> str:
    first = int(model.body_jntadr[int(model.jnt_bodyid[j])])
    return _joint(model, j, j - first + 1)


def words(values: ArrayLike) -> str:
    """Return numbers as text in full precision."""
    return " ".join(repr(float(v)) for v in np.ravel(values))
