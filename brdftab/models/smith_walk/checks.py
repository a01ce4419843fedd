"""What `brdftab check` should know of this model."""

THIN = {"fast": 14, "full": 3}
DIRECTIONS = {"fast": 4, "full": 2}
# mirrors, and glass with light from either side
FURNACE = ({"material": "mirror"}, {"ior": 1.5})
