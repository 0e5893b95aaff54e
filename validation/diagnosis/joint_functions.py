"""List candidate functions that act at several locations of the machine.

For example, all bodies may swell with humidity, or all drives may have backlash.  The
function has the same form at all locations, but separate coefficients.
"""

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.effects.friction_hysteresis import elastic_joints
from forcefit.assembly.effects.functions import AXES, THREAD
from forcefit.assembly.effects.places import drives
from forcefit.validation.diagnosis import function_forms as forms
from forcefit.validation.diagnosis.candidates import (
    Candidate,
    CandidatePart,
    own_component,
    places_of,
)
from forcefit.validation.diagnosis.elements import Element
from forcefit.validation.diagnosis.function_forms import CandidateShape, is_angle
from forcefit.validation.diagnosis.functions import Functions
from forcefit.validation.diagnosis.gaussian import SIZES

# Compliance proportional to the square of the wrench.
_CUBIC = CandidateShape("powers", ("2",))
Parts = tuple[CandidatePart, ...]


def joint_functions(functions: Functions, rows: NDArray) -> list[Element]:
    """Return functions at several locations that affect the readings.

    Args:
        functions: functions at single locations.
        rows: rows for which design matrices are computed.
    """
    some = functions.at_rows(rows)
    listed: list[tuple[Candidate, float]] = []
    for kind, parts, tried in (*_by_kind(functions), *_at_drives(functions)):
        own = parts[0].variables
        listed += [(Candidate(parts, kind, s), functions.prior(own, s)) for s in tried]
    listed += _of_wrench(functions)
    made = [some.element(one, prior) for one, prior in listed]
    return [e for e in made if e is not None and e.most > SIZES[0]]


def _of_wrench(functions: Functions) -> list[tuple[Candidate, float]]:
    """Return functions of the joint wrench, such as backlash and nonlinear springs."""
    names = functions.places.names
    joints = [p[0] for p in names if len(p) == 1 and p[0][2] == "compliance"]
    prior = -math.log(4.0 * max(len(functions.variables), 1) * max(len(joints), 1))
    listed = []
    for name, component, kind in joints:
        if component == THREAD:  # the wrench along a thread is not a variable
            continue
        wrench = f"wrench.{name}.{'mf'[component[0] == 't']}{component[1]}"
        part = CandidatePart(name, (component,), wrench)
        listed.append((Candidate((part,), kind, _CUBIC), prior))
        knees = _knees(functions, name, component)
        for shape in knees:
            share = math.log(1.0 if shape.names == ("size",) else len(knees))
            listed.append((Candidate((part,), "screw", shape), prior - share))
    return listed


def _knees(functions: Functions, name: str, component: str) -> list[CandidateShape]:
    """Return springs with load-dependent stiffness for the load of a joint."""
    robot = functions.conditions.robot
    frame, axis = robot.frame(name), AXES.index(component)
    if frame.pitch:  # the wrench along a thread is not a variable
        return []
    if axis != frame.own_axis or name not in (*drives(robot), *elastic_joints(robot)):
        return []
    load = functions.sensitivities.wrenches[:, robot.index(name), axis]
    # For a slide, a jump at zero load is equivalent to joint clearance, which is an
    # effect in the library.
    return forms.knees(np.abs(load), jump=frame.turns)


def _by_kind(functions: Functions) -> Iterator[tuple[str, Parts, list[CandidateShape]]]:
    """Return functions that act on all bodies or on all drives."""
    for kind, parts in places_of(functions.campaign.robot, functions.variables):
        if len(parts) > 1:
            known = functions.known(parts[0].variable)
            tried = forms.first(known, parts[0].variable)
            if kind == "compliance":
                tried += forms.uneven(known, parts[0].variable)
            yield kind, parts, tried


def _at_drives(
    functions: Functions,
) -> Iterator[tuple[str, Parts, list[CandidateShape]]]:
    """Return functions that act on all drives."""
    conditions, robot = functions.conditions, functions.campaign.robot
    own = [(f.name, (own_component(f),)) for f in robot.frames if f.actuated]
    if len(own) < 2:
        return
    sided = "approach" in functions.variables
    for name in functions.variables:
        if name.startswith("q."):
            continue
        parts = tuple(CandidatePart(w, c, name) for w, c in own)
        yield "screw", parts, forms.first(functions.known(name), name)
        known = functions.known("approach", name)
        both = forms.of_two(known, "approach", name)
        if sided and name != "approach" and both is not None and len(known):
            yield "screw", tuple(CandidatePart(w, c, *both[0]) for w, c in own), both[1]
    if all(is_angle(robot, f"q.{w}") for w, _ in own):
        turns = tuple(CandidatePart(w, c, f"q.{w}") for w, c in own)
        yield "screw", turns, forms.of_direction(conditions, turns[0].variable)
        both = forms.of_two(conditions, turns[0].variable, "approach")
        if sided and both is not None:
            sides = tuple(replace(part, second_variable="approach") for part in turns)
            yield "screw", sides, both[1]
