"""Virtual-joint model of a manipulator: its pose, elastic energy and errors.

Begin with ``model/robot.py``, then ``kinematics/posture.py``, ``linear/energy.py``.
"""

if __name__ == "assembly":  # the package name in the last release
    from forcefit.old_packages import use_present_name

    use_present_name(__name__)
