"""What `brdftab check` should know of this model."""

# facets that are tilted lose light by design: a single bounce
FURNACE = ({"kd": 1.0, "ndf": "beckmann", "sigma": 0.0},)
