"""Tables with their error: filling and refining grids, cell averages, estimates, provenance."""
