"""Error against run time of every method that can compute a model, measured on one set of directions."""
