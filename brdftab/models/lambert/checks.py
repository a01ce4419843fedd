"""What `brdftab check` should know of this model."""

FURNACE = ({"kd": 1.0},)
