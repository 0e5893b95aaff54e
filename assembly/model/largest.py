"""Largest accepted numbers in files and options."""

# [m] largest length, also used for angles [rad] and direction components
LARGEST_LENGTH = 1e6
LARGEST = 1e40  # [SI units] largest value of other numbers; 1 / LARGEST is the smallest
