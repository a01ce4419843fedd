"""What values lie on and what came out: grids, tables, their storage, measurements, comparisons."""
