"""What tests take of the sweep that `brdftab check` runs: variants, directions, derivatives by differences."""

from brdftab.validate.angles import directions
from brdftab.validate.differences import differences, entry, has_nodes, kernel_values, moved
from brdftab.validate.sweep import Variant, seeded, setups, variants

# twins that solve equations where the data have their angles: they and the compiled solver agree to what either's nodes
# resolve (2e-6 at alpha 0.6, test_smith_twin.py), and random directions would cost the solver minutes
SOLVED = frozenset({"smith-multi"})

__all__ = [
    "SOLVED",
    "Variant",
    "differences",
    "directions",
    "entry",
    "has_nodes",
    "kernel_values",
    "moved",
    "seeded",
    "setups",
    "variants",
]
