"""Virtual-joint model of a manipulator: its pose, elastic energy and errors.

Begin with ``model/robot.py``, then ``kinematics/posture.py``, ``linear/energy.py``.
"""

# ``import forcefit`` searches this text to recognise the package as its own
DISTRIBUTION = "forcefit"
