"""What `brdftab check` should know of this model."""

THIN = {"fast": 10, "full": 3}
SCANS = {"full": 2}
SKIP_FAST = {"continuity": "every roughness integrates its own albedo: in the full check"}
