"""What pose, what energy, what error?  The virtual-joint model of the manipulator.

Begin at ``model/robot.py``, then ``kinematics/posture.py`` and ``linear/energy.py``.
"""

DISTRIBUTION = "forcefit"  # which `import forcefit` looks for
