"""What the modules of a model's folder must and may provide: the contract between models and all that serves them.

A folder holds ``__init__`` (`SPEC`, a `Model`), ``kernel`` (`Kernel`), and, where the model has them, ``twin``
(`Twin`), ``sample`` (`Sampler`), ``checks`` (`Checks` called ``CHECKS``), ``validate_setup``, ``mitsuba`` and ``glsl``.
Capabilities that not every model has are protocols of their own: ``isinstance(kernel, HasAlbedo)`` asks. Arrays are
float64, angles radians, (N,) for N pairs of directions, values (N, P, C) in 1/sr: P components, C channels.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from brdftab.models._shared.random_walk.estimates import Estimates
    from brdftab.models.resolve import Setup

    Array = NDArray[np.float64]
    Samples = tuple[Array, Array, NDArray[np.bool_]]

Given = dict[str, Any]


class Evaluator(Protocol):
    """A setup prepared once, for many directions: what `HasEvaluator.prepare` returns."""

    def points(self, theta_i: Array, theta_o: Array, phi: Array, phi_i: Array) -> Array:
        """Return (N, P, C) at N pairs of directions."""

    def fill(self, theta_i: Array, theta_o: Array, phi: Array, square: bool, out: NDArray[np.floating]) -> None:
        """Fill out (P, I, O, F, C), float32 or float64, on a product grid; `square`: both polar axes are the same."""


class Kernel(Protocol):
    """``kernel``: values in Numba."""

    def points(
        self, setup: Setup, theta_i: Array, theta_o: Array, phi: Array, phi_i: Array, *, orders: int, tolerance: float
    ) -> Array:
        """Return (N, P, C) at N pairs of directions, 0 at and below the horizon; P = 1 for orders = 0, the total."""


@runtime_checkable
class HasEvaluator(Kernel, Protocol):
    """Kernels with a fast path of isotropic setups."""

    def prepare(self, setup: Setup, tolerance: float, orders: int = 0, trial: bool = False) -> Evaluator | None:
        """Return what evaluates a setup, or None where only `points` keeps the tolerance or the components apart.

        `trial` prepares coarsely, only to compile.
        """


@runtime_checkable
class HasAlbedo(Kernel, Protocol):
    """Kernels that know their directional albedo."""

    def albedo(self, setup: Setup, theta_i: Array, phi_i: float, tolerance: float) -> Array:
        """Return (T, C): the light that leaves, of light from each polar angle."""


@runtime_checkable
class HasSplitAlbedo(Kernel, Protocol):
    """Kernels that know what of the albedo is reflected and what transmitted."""

    def split_albedo(self, setup: Setup, theta_i: Array, phi_i: float, tolerance: float) -> tuple[Array, Array]:
        """Return the light (T, C) that leaves above the surface, and below it."""


@runtime_checkable
class HasSmoothAlbedo(Kernel, Protocol):
    """Kernels whose albedo is integrated in two parts: without, and with the mirror lobes."""

    def smooth_albedo(self, setup: Setup, theta: float, phi: float, tolerance: float) -> Array | None:
        """Return the albedo (C,) of everything but `specular_points`, or None where only points serve."""

    def specular_points(
        self, setup: Setup, theta_i: Array, theta_o: Array, phi: Array, phi_i: Array, tolerance: float
    ) -> Array:
        """Return (N, C): what `smooth_albedo` leaves out."""


@runtime_checkable
class HasDelta(Kernel, Protocol):
    """Kernels of flat interfaces, which reflect a share of the light into the mirror direction alone."""

    def mirror_reflectance(self, setup: Setup, theta_i: Array) -> Array:
        """Return that share (N, C), part of the first component and of no value."""


@runtime_checkable
class HasSingularSetup(Kernel, Protocol):
    """Kernels whose bounces that are infinite at the mirror direction are those of another setup."""

    def singular_setup(self, setup: Setup) -> Setup | None:
        """Return that setup, or None where nothing is infinite."""


@runtime_checkable
class HasEnergyLeftOut(Kernel, Protocol):
    """Kernels that know what a cap of the bounces leaves out."""

    def energy_left_out(self, setup: Setup, theta: Array) -> Array | None:
        """Return its albedo (T, C), or None where nothing can be said."""


@runtime_checkable
class HasFinestRule(Kernel, Protocol):
    """Kernels whose rules end somewhere."""

    def finest(self, setup: Setup) -> float:
        """Return the tolerance of the finest rule, which serves all tighter ones."""


@runtime_checkable
class HasTwinNodes(Kernel, Protocol):
    """Kernels that can take the sum that their twin takes."""

    def at_twin_nodes(
        self, setup: Setup, theta_i: Array, theta_o: Array, phi: Array, phi_i: Array, tolerance: float
    ) -> Array:
        """Return (N, C) summed over the twin's fixed nodes."""


@runtime_checkable
class SolvesJointly(Kernel, Protocol):
    """Kernels that solve directions together: how many there are turns the last bits, so that blocks have one size."""

    JOINT: bool


@runtime_checkable
class Stochastic(Kernel, Protocol):
    """Kernels that estimate some setups by drawing paths."""

    def stochastic(self, setup: Setup) -> bool:
        """Tell whether values of a setup carry a statistical error."""

    def estimates(
        self, setup: Setup, theta_i: Array, theta_o: Array, phi: Array, phi_i: Array, *, orders: int, tolerance: float
    ) -> Estimates:
        """Return values with standard errors at N pairs of directions."""

    def estimate_table(
        self,
        setup: Setup,
        axes: dict[str, Array],
        *,
        orders: int,
        tolerance: float,
        progress: Callable[[float], None] | None = None,
    ) -> Estimates:
        """Return values with standard errors on a product grid."""


class Sampler(Protocol):
    """``sample``: importance sampling."""

    def sample(self, setup: Setup, theta_i: float, phi_i: float, n: int, rng: np.random.Generator) -> Samples:
        """Return theta_o, phi_o (N,) and which samples are valid."""

    def pdf(self, setup: Setup, theta_i: Array, theta_o: Array, phi: Array, phi_i: Array) -> Array:
        """Return the density (N,) in 1/sr with which `sample` draws; it integrates to the share of valid samples."""


@runtime_checkable
class DrawsWalks(Sampler, Protocol):
    """Samplers that draw whole walks between facets."""

    def walk(
        self, setup: Setup, theta_i: float, phi_i: float, n: int, rng: np.random.Generator
    ) -> tuple[Array, Array, NDArray[np.bool_], Array]:
        """Return what `sample` does, and the walks' throughput (N, C)."""


@runtime_checkable
class DrawsDelta(Sampler, Protocol):
    """Samplers that draw the mirror direction itself."""

    def mirror_mass(self, setup: Setup, theta_i: Array) -> Array:
        """Return the probability (N,) with which they do."""


class Twin(Protocol):
    """``twin``: the kernel again, in JAX, differentiable in its numbers; `static` holds the choices."""

    SHAPE_PARAMS: tuple[str, ...]

    def shapes(self, static: Any, p: dict[str, Any], d: Any) -> Any:
        """Return what depends on the parameters `SHAPE_PARAMS` alone, which channels share."""

    def value(self, static: Any, p: dict[str, Any], shapes: Any, d: Any) -> Any:
        """Return (N,): the values of one channel with parameters p at directions d."""


@runtime_checkable
class HasRuleNodes(Twin, Protocol):
    """Twins that sum over nodes which a tolerance chooses."""

    def rule_nodes(self, static: Any, tolerance: float) -> dict[str, Any]:
        """Return the nodes as numbers, added to the parameters."""


@runtime_checkable
class HasDataNodes(Twin, Protocol):
    """Twins with numbers that follow from the data's angles."""

    def nodes(self, static: Any, theta_i: Any, theta_o: Any, phi: Any) -> dict[str, Any]:
        """Return these numbers, added to the parameters under the name ``nodes``."""


@runtime_checkable
class HasPreparation(Twin, Protocol):
    """Twins with a costly part that no single point enters."""

    def prepare(self, static: Any, p: dict[str, Any]) -> Any:
        """Return that part, added to the parameters under the name ``prepared``."""


@runtime_checkable
class RefusesChoices(Twin, Protocol):
    """Twins that do not serve every choice of their model."""

    def check(self, static: Any) -> None:
        """Raise `ParameterError` for choices without a twin."""


@runtime_checkable
class NarrowsRoughness(Twin, Protocol):
    """Twins that are fitted within narrower bounds than declared."""

    def roughness_bounds(self, ndf: str) -> tuple[float, float]:
        """Return the bounds of the roughness for a distribution."""


@runtime_checkable
class RulesByRoughness(Twin, Protocol):
    """Twins whose rules hang on a class of the roughness."""

    ROUGH_RULES: bool


class ValidatesSetup(Protocol):
    """``validate_setup``: what hangs on several parameters at once."""

    def validate_setup(self, setup: Setup) -> Setup:
        """Return the setup, perhaps completed, or raise `ParameterError`."""


class MitsubaModule(Protocol):
    """``mitsuba``: what computes the same in Mitsuba 3."""

    def plugin(self, setup: Setup) -> dict[str, Any] | str:
        """Return the plugin's dictionary, or why there is none."""


class ShaderModule(Protocol):
    """``glsl``: the model as a shader's function."""

    def source(self) -> str:
        """Return GLSL source."""


@dataclass(frozen=True)
class Checks:
    """What a model tells `brdftab check` of itself; `CHECKS` of its module ``checks``.

    Attributes
    ----------
    tolerance : float or None
        At which the checks evaluate; by default 1e-6.
    cheap : mapping
        Parameters that keep it quick.
    at_most : mapping
        Of a parameter that makes it slow, the largest value that is checked.
    settings : tuple of mapping
        Extremes that no bound tells.
    furnace : tuple of mapping or None
        Settings that must return all light; by default mirrors where all bounces count.
    switches : tuple
        Where it changes formula: words, parameters, what is varied, the value at which.
    skip, skip_fast : mapping
        By property, why it is not measured; in fast checks alone.
    no_scan : tuple of str
        Parameters along which jumps are not looked for.
    uncapped : bool
        False where bounces end even if no cap is given.
    cone : str
        The parameter that is the half width of a cone.
    reciprocity, twin_tolerance : float or None
        What swapped pairs, and the twin, may differ by, where it is more than usual.
    unresolved : mapping or None
        Ranges of a conductor's numbers that a known limit of the tolerance names.
    thin, directions, scans, variants, box : mapping
        By "fast" and "full", for expensive models: every n-th setting (bounds apart), every n-th direction, and how
        many scans, variants of the twin and corners of the box of parameters.
    twin_directions, switch_directions : int or None
        How many.
    twin_thin : int
        Every n-th setting of the twin.
    """

    tolerance: float | None = None
    cheap: Given = field(default_factory=dict)
    at_most: Mapping[str, float] = field(default_factory=dict)
    settings: tuple[Given, ...] = ()
    furnace: tuple[Given, ...] | None = None
    switches: tuple[tuple[str, Given, str, float], ...] = ()
    skip: Mapping[str, str] = field(default_factory=dict)
    skip_fast: Mapping[str, str] = field(default_factory=dict)
    no_scan: tuple[str, ...] = ()
    uncapped: bool = True
    cone: str = ""
    reciprocity: float | None = None
    twin_tolerance: float | None = None
    unresolved: Mapping[str, tuple[float, float]] | None = None
    thin: Mapping[str, int] = field(default_factory=dict)
    directions: Mapping[str, int] = field(default_factory=dict)
    scans: Mapping[str, int] = field(default_factory=dict)
    variants: Mapping[str, int] = field(default_factory=dict)
    box: Mapping[str, int] = field(default_factory=dict)
    twin_directions: int | None = None
    switch_directions: int = 40
    twin_thin: int = 1
