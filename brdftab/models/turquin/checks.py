"""What `brdftab check` should know of this model."""

THIN = {"fast": 10, "full": 3}
SCANS = {"full": 2}
SKIP_FAST = {"continuity": "every roughness integrates its own albedo: in the full check"}
SWITCHES = (
    ("rules of the albedo at 1e-4", {"ndf": "ggx", "alpha": 0.5, "material": "Au"}, "tolerance", 1e-4),
    ("few nodes of smooth facets", {"ndf": "beckmann", "alpha": 0.2999, "f0": 0.5}, "tolerance", 1e-4),
)
