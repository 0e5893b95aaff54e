"""Robots with helical joints, described by bodies and joints."""

LIFT = """
format = 2
name = "screw_lift"
platform = "table"
platform_at = [0.3, 0, 0.4]
[[body]]
name = "screw"
[[body]]
name = "table"
mass = 8
centre = [0.2, 0, 0.4]
[[joint]]
name = "bearing"
type = "revolute"
between = ["base", "screw"]
at = [0, 0, 0]
axis = [0, 0, 1]
actuated = true
drive_stiffness = 200
[[joint]]
name = "nut"
type = "helical"
pitch = "5 mm"
between = ["screw", "table"]
at = [0, 0, 0.4]
axis = [0, 0, 1]
[[joint]]
name = "column"
type = "cylindrical"
between = ["base", "table"]
at = [0.2, 0, 0.2]
axis = [0, 0, 1]
"""

# per turn of the screw, the platform moves by the difference of the pitches
DIFFERENTIAL = """
format = 2
platform = "table"
platform_at = [0.1, 0, 0.1]
[[body]]
name = "screw"
[[body]]
name = "table"
[[joint]]
name = "coarse"
type = "helical"
pitch = "5 mm"
between = ["base", "screw"]
at = [0, 0, 0]
axis = [0, 0, 1]
actuated = true
drive_stiffness = 50
[[joint]]
name = "fine"
type = "helical"
pitch = "4 mm"
between = ["table", "screw"]
at = [0, 0, 0.1]
axis = [0, 0, 1]
[[joint]]
name = "guide"
type = "prismatic"
between = ["base", "table"]
at = [0.1, 0, 0]
axis = [0, 0, 1]
"""

NUT = """
format = 2
platform = "nut"
platform_at = [0, 0, 0]
[[body]]
name = "nut"
[[joint]]
name = "thread"
type = "helical"
pitch = "4 mm"
between = ["base", "nut"]
at = [0, 0, 0]
axis = [0, 0, 1]
clearance = { axial = "25 um" }
[[joint]]
name = "guide"
type = "revolute"
between = ["base", "nut"]
at = [0, 0, 0]
axis = [0, 0, 1]
"""
