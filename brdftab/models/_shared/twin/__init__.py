"""The microfacet pieces in JAX, under the names of the Numba ones, differentiable in all their parameters.

Importing anything from here switches JAX to float64: the twins are held to the kernels at 1e-11.
"""

import jax

jax.config.update("jax_enable_x64", True)
