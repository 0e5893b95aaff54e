"""Upper limits for numbers in files and options; larger numbers are rejected."""

# [m] upper limit for lengths, also used for angles [rad] and direction components
LARGEST_LENGTH = 1e6
LARGEST = 1e40  # [SI units] limit for other numbers; its inverse is the lower limit
