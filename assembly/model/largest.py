"""Upper limits of numbers in files and options; larger numbers are mistakes."""

LARGEST_LENGTH = 1e6  # [m] larger than any machine; also limits angles and directions
LARGEST = 1e40  # in SI units: larger than any property; lower limits are its inverse
