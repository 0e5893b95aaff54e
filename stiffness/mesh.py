"""Surfaces and their tetrahedra."""

from stiffness.interface import Interface, parse_interface

__all__ = ["Interface", "parse_interface"]
