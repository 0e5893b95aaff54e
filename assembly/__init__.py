"""Virtual-joint model of a manipulator: its pose, elastic energy and errors.

Begin with ``model/robot.py``, then ``kinematics/posture.py``, ``linear/energy.py``.
"""

DISTRIBUTION = "forcefit"  # text by which ``import forcefit`` recognises the package
