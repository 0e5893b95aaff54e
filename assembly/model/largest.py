"""Upper limits of numbers in files and options; larger numbers are mistakes."""

# [m] upper limit of lengths; also used for angles [rad] and components of directions
LARGEST_LENGTH = 1e6
LARGEST = 1e40  # [SI] upper limit of other numbers; its inverse is the lower limit
