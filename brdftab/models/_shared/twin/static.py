"""What a twin must know when it is traced: everything that is not a number to differentiate by."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

# name under which weights (W, C) of wavelengths go beside a twin's numbers: no parameter can be called so
WEIGHTS = "spectral weights"


@dataclass(frozen=True)
class Static:
    """The choices of a setup; hashable, so that JAX compiles once for each.

    Attributes
    ----------
    model : str
        Registry name.
    ndf : int
        Code of the normal distribution, -1 without facets.
    fresnel : int
        Kind of the reflectance: 0 mirror, 1 conductor (a = eta, b = k), 2 dielectric (a = index), 3 Schlick (a = f0),
        4 Lazányi and Szirmay-Kalos (a = f0, b = dip), -1 none.
    isotropic : bool
        True when alpha_x serves both axes; alpha_y is then not looked at.
    options : tuple of (str, object)
        Choice parameters by name, such as ``("masking", "separable")``.
    max_bounces : int or None
        Cap of the bounce orders.
    tolerance : float
        Relative error asked of the model's rules; it chooses their nodes.
    precision : {"float64", "float32"}
        Of the inner loops of models that offer one.
    rough : float
        Upper end of the class of roughness, of models whose rules grow with it, else 1. A fit keeps that of its start.
    """

    model: str
    ndf: int = -1
    fresnel: int = -1
    isotropic: bool = True
    options: tuple[tuple[str, Any], ...] = ()
    max_bounces: int | None = None
    tolerance: float = 1e-9
    precision: str = "float64"
    rough: float = 1.0

    def option(self, name: str) -> Any:
        """Return one choice parameter; KeyError if the model has none of that name."""
        return dict(self.options)[name]
