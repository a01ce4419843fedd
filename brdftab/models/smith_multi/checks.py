"""What `brdftab check` should know of this model."""

from brdftab.models.protocols import Checks

CHECKS = Checks(
    # the solver's grid of angles, orders and nodes serves a table; single pairs are expensive
    tolerance=1e-3,
    thin={"fast": 30, "full": 8},
    directions={"fast": 30, "full": 10},
    scans={"fast": 1, "full": 1},
    # mirrors, and glass with light from either side
    furnace=({"material": "mirror"}, {"ior": 1.5}),
    # light from above and from within glass is solved apart at the tolerance above; 2.6e-6 measured between the two
    reciprocity=1e-5,
    skip={
        "gradient": "the twin solves at the data's angles: compared with differences in test_smith_twin.py",
        "twin": "the twin solves at the data's angles: compared with the solver in test_smith_twin.py",
    },
    skip_fast={
        "continuity": "each position of a line is solved anew: in the full check",
        "stiffness": "the twin solves at the data's angles: in the full check",
        "tolerance": "tight tolerances are solved on many nodes: in the full check",
    },
    box={"full": 4},
    switches=(("nodes at 5e-4", {"ndf": "ggx", "alpha": 0.5, "material": "mirror"}, "tolerance", 5e-4),),
)
