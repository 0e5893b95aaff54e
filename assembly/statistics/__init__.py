"""What errors drawn at random do, and how loose tolerances may be."""
