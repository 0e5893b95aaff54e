"""Robot file of a two-axis stage with two guides and a pad."""

# A tool moves on two crossed rails.  Its sole lies between two planes of the base.
STAGE = """
format = 2
name = "stage"
platform = "tool"
platform_at = ["30 mm", "50 mm", "200 mm"]
[[body]]
name = "slide"
[[body]]
name = "tool"
[[body.tolerance]]
name = "sole"
feature = "foot"
datums = ["y"]
profile = "0.03 mm"
extent = ["60 mm", "36 mm"]
flatness = "0.01 mm"
[[joint]]
name = "x"
type = "prismatic"
between = ["base", "slide"]
at = ["10 mm", "-40 mm", "30 mm"]
axis = [1, 0, 0]
axis2 = [0, 1, 0]
actuated = true
[joint.clearance.guide]
fit = ["40 H7/g6", "30 H8/f7"]
length = "80 mm"
width = "40 mm"
height = "30 mm"
[[joint]]
name = "y"
type = "prismatic"
between = ["slide", "tool"]
at = ["25 mm", "35 mm", "90 mm"]
axis = [0, 1, 0]
axis2 = [0, 0, 1]
actuated = true
[joint.clearance.guide]
gap = "12 um"
length = "70 mm"
width = "50 mm"
height = "24 mm"
[[joint]]
name = "foot"
type = "planar"
between = ["base", "tool"]
at = ["20 mm", "50 mm", "150 mm"]
axis = [0, 0, 1]
clearance = { pad = { gap = "8 um", length = "60 mm", width = "36 mm" } }
"""
