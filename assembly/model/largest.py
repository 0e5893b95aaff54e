"""Sizes beyond any machine: larger numbers in a file or an option are mistakes."""

LARGEST_LENGTH = 1e6  # [m] larger than any machine; also bounds angles and directions
LARGEST = 1e40  # in SI: beyond any stiffness, section or density; 1 / it is the least
