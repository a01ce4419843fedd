"""Extruded scratches with all interreflections between their walls."""
