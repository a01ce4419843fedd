"""One traced scratch in the hands of the user: any material afterwards, without tracing again."""

from __future__ import annotations

import math
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from brdftab.errors import ParameterError
from brdftab.evaluation.importance_sampling import Samples
from brdftab.materials.fresnel import Fresnel
from brdftab.models.resolve import resolve
from brdftab.models.scratch import blur, light
from brdftab.models.scratch.bounds import BINS as BOUNDS
from brdftab.models.scratch.cone_samples import density, draw
from brdftab.models.scratch.profiles import Profile, measured, parse
from brdftab.models.scratch.shoot import ORDERS
from brdftab.models.scratch.trace import BINS, CAP, Traced, distance, rays_for, trace
from brdftab.tables.content import SeveralArrays, told
from brdftab.typing import Array

PSI = math.radians(1.0)
# the second trace of an error estimate starts its rays here
SHIFT = 0.37
MOST_RAYS = 1_000_000


class Scratch(SeveralArrays):
    """A traced scratch along azimuth 0; see `trace_scratch`. A scratch is equal (``==``) to itself alone.

    Directions have an angle along the scratch, t = asin(sin theta cos azimuth), and one across,
    p = atan2(sin theta sin azimuth, cos theta). A mirror reflects t_i into -t_i; across, light goes from bin to bin.

    Attributes
    ----------
    traced : Traced
        The numbers behind it.
    """

    _arrays = "flux, lost, phi_edges, rho()"

    def __init__(self, traced: Traced) -> None:
        self.traced = traced

    def __repr__(self) -> str:
        one = self.traced
        return told(self, one.profile.text, f"{one.bins} bins", f"{one.rays:,} rays a bin", f"cap {one.cap}")

    @property
    def profile(self) -> Profile:
        """The cross-section."""
        return self.traced.profile

    @property
    def bins(self) -> int:
        """Number M of bins of the angle across."""
        return self.traced.bins

    @property
    def phi_edges(self) -> Array:
        """Edges (M + 1,) of the bins of the angle across, radians in [-pi/2, pi/2]."""
        return self.traced.phi_edges

    @property
    def flux(self) -> Array:
        """Flux (5, M, M) of perfect mirrors by bounce order (1 to 4, and more), exit and incident bin.

        Symmetric; the columns of the sum over orders add up to the integral of the cosine over the bin, less `lost`.
        """
        return self.traced.flux

    @property
    def lost(self) -> Array:
        """Share (M,) of each incident bin's light that the cap of bounces cuts off; not made up for."""
        return self.traced.lost

    @cached_property
    def error(self) -> float:
        """L1 distance to an independent trace with as many rays: twice the share of all light that leaves elsewhere."""
        one = self.traced
        return distance(one, trace(one.profile, one.bins, one.rays, one.cap, SHIFT))

    def rho(self, order: int | None = None) -> Array:
        """Return rho (M, M) of perfect mirrors in 1/rad, by exit and incident bin.

        The radiance towards p_o is int rho(p_o, p_i) L(p_i) cos(p_i) dp_i over the cone.

        Parameters
        ----------
        order : int, optional
            1 to 4, or 5 for all higher ones; by default all bounces.

        Raises
        ------
        ParameterError
            If there is no such order.
        """
        if order is not None and order not in range(1, ORDERS + 1):
            raise ParameterError.out_of_range("order", order, f"[1, {ORDERS}]", f"{ORDERS} holds all higher ones")
        flux = self.flux.sum(axis=0) if order is None else self.flux[order - 1]
        share = self.traced.aperture
        return flux / (share[:, None] * share)

    def shaded(self, t: float, fresnel: Fresnel) -> Array:
        """Return rho (M, M, C) with Fresnel at the angle t (radians) along the scratch."""
        return self.traced.shaded(t, fresnel)

    def albedo(self, theta: ArrayLike, **material: Any) -> Array:
        """Return the share of light that leaves, all angles across lit evenly.

        Parameters
        ----------
        theta : array_like (...)
            Angle along the scratch, radians in [-pi/2, pi/2].
        **material
            ``material``, ``eta`` and ``k``, ``ior``, or ``f0``, as in the registry.

        Returns
        -------
        ndarray (..., C)

        Raises
        ------
        ParameterError
            If the material or an angle is not valid.
        """
        angles = np.asarray(theta, dtype=np.float64)
        bad = ~(np.abs(angles) <= 0.5 * math.pi)
        if bad.any():
            shown = f"{math.degrees(angles[bad].flat[0]):g} degrees"
            raise ParameterError.out_of_range("theta", shown, "[-90, 90] degrees", "it is measured along the scratch")
        fresnel = material_of(material)
        share = 0.5 * self.traced.aperture
        rows = [share @ self.traced.reflected(float(t), fresnel) for t in angles.reshape(-1)]
        return np.reshape(rows, (*angles.shape, len(fresnel.channels)))

    def evaluate(
        self,
        theta_i: ArrayLike,
        theta_o: ArrayLike,
        phi: ArrayLike,
        *,
        phi_i: ArrayLike = 0.0,
        psi: float = PSI,
        **material: Any,
    ) -> Array:
        """Evaluate the BRDF with its cone blurred to half width psi.

        Parameters
        ----------
        theta_i, theta_o, phi, phi_i : array_like
            Directions as in `brdftab.evaluate`, radians.
        psi : float
            Radians.
        **material
            As in `albedo`.

        Returns
        -------
        ndarray (..., C)
            In 1/sr without cosine.

        Raises
        ------
        ParameterError
            If the material or psi is not valid.
        """
        setup = resolve("scratch", psi=psi, **material)
        assert setup.fresnel is not None
        shape, (ti, to, dphi, pi) = _flat(theta_i, theta_o, phi, phi_i)
        values = blur.points(self.traced, setup.fresnel, setup.values["psi"], ti, to, dphi, pi, 1)
        return values[:, 0].reshape(*shape, -1)

    def lit(
        self,
        theta_l: ArrayLike,
        theta_o: ArrayLike,
        phi: ArrayLike,
        *,
        phi_l: ArrayLike = 0.0,
        psi: float = PSI,
        **material: Any,
    ) -> Array:
        """Return what views see of a distant light that is widened to the half angle psi.

        Parameters
        ----------
        theta_l, phi_l, theta_o, phi : array_like
            Directions of light and view, phi = phi_o - phi_l, radians.
        psi : float
            Half angle of the kernel (1 - (angle/psi)^2)^2 around the light, radians.
        **material
            As in `albedo`.

        Returns
        -------
        ndarray (..., C)
            Radiance over the irradiance on a surface that faces the light, 1/sr; the cosine of theta_l is in it.

        Raises
        ------
        ParameterError
            If the material or psi is not valid.
        """
        setup = resolve("scratch", psi=psi, **material)
        assert setup.fresnel is not None
        shape, (tl, to, dphi, pl) = _flat(theta_l, theta_o, phi, phi_l)
        return light.lit(self.traced, setup.fresnel, setup.values["psi"], tl, to, dphi, pl).reshape(*shape, -1)

    def sample(
        self, theta_i: float, n: int, *, phi_i: float = 0.0, psi: float = PSI, seed: int = 0, **material: Any
    ) -> Samples:
        """Draw `n` outgoing directions with weights and densities; see `brdftab.sample`."""
        setup = resolve("scratch", psi=psi, **material)
        rng = np.random.Generator(np.random.PCG64(seed))
        theta_o, phi_o, valid = draw(self.traced, psi, theta_i, phi_i, n, rng)
        light = np.full(n, float(theta_i)), theta_o, phi_o - phi_i, np.full(n, float(phi_i))
        pdf = np.where(valid, density(self.traced, psi, *light), 0.0)
        assert setup.fresnel is not None
        f = blur.points(self.traced, setup.fresnel, psi, *light, 1)[:, 0]
        # a density of 0 at a drawn direction can only come from rounding at the edge of its support
        safe = np.where(pdf > 0.0, pdf, math.inf)
        weight = np.where(valid[:, None], f * (np.cos(theta_o) / safe)[:, None], 0.0)
        return Samples(theta_o, phi_o, weight, valid, pdf, np.zeros(valid.shape, dtype=bool))

    def pdf(
        self, theta_i: ArrayLike, theta_o: ArrayLike, phi: ArrayLike, *, phi_i: ArrayLike = 0.0, psi: float = PSI
    ) -> Array:
        """Return the density in 1/sr that `sample` draws from, of the broadcast shape; radians."""
        shape, (ti, to, dphi, pi) = _flat(theta_i, theta_o, phi, phi_i)
        return density(self.traced, psi, ti, to, dphi, pi).reshape(shape)


def _flat(*angles: ArrayLike) -> tuple[tuple[int, ...], list[Array]]:
    """Return the broadcast shape of angles, and each as a row."""
    every = np.broadcast_arrays(*(np.asarray(a, dtype=np.float64) for a in angles))
    return every[0].shape, [a.flatten() for a in every]


def material_of(material: dict[str, Any]) -> Fresnel:
    """Return the reflectance that material keywords name; raises `ParameterError`."""
    fresnel = resolve("scratch", **material).fresnel
    assert fresnel is not None
    return fresnel


def trace_scratch(
    profile: str | ArrayLike,
    bins: int = BINS,
    rays: int | None = None,
    tolerance: float | None = None,
    *,
    cap: int = CAP,
) -> Scratch:
    """Trace the light between the walls of a scratch.

    Parameters
    ----------
    profile : str or array_like (N,)
        ``"quartic:1"``, ``"v:45"``, ``"u:1"``, ``"ellipse:1"``, ``"flat"``, ``"file:PATH"``, or heights at equal steps
        across, in half widths.
    bins : int, optional
        Bins of the angle across, [8, 512].
    rays : int, optional
        Rays a bin, [16, 1e6]; by default 512, or what `tolerance` asks.
    tolerance : float, optional
        L1 error asked: rays are doubled until `Scratch.error` is below it.
    cap : int, optional
        Largest number of bounces; what it cuts off is in `Scratch.lost`.

    Returns
    -------
    Scratch

    Raises
    ------
    ParameterError
        If the profile or a number is not valid, `rays` and `tolerance` are both given, or the tolerance is not met with
        a million rays.
    FileFormatError
        If a file holds no heights.
    """
    shape = parse(profile) if isinstance(profile, str) else measured(np.asarray(profile, dtype=np.float64))
    for name, value, (low, high) in (
        ("bins", bins, BOUNDS), ("rays", rays, (16, MOST_RAYS)), ("cap", cap, (1, 1_000_000)),
    ):  # fmt: skip
        if value is not None and not (isinstance(value, int | np.integer) and low <= value <= high):
            raise ParameterError.out_of_range(name, value, f"the whole numbers in [{low}, {high}]")
    if tolerance is None:
        return Scratch(trace(shape, bins, rays or rays_for(1e-3), cap))
    if rays is not None:
        raise ParameterError(f"rays = {rays} and tolerance = {tolerance:g} exclude each other; give one of them")
    if not 1e-5 <= tolerance <= 1.0:
        raise ParameterError.out_of_range("tolerance", tolerance, "[1e-5, 1]", "it is an L1 error of the flux")
    count = 64
    while count <= MOST_RAYS:
        found = Scratch(trace(shape, bins, count, cap))
        if found.error <= tolerance:
            return found
        count *= 2
    raise ParameterError(
        f"tolerance = {tolerance:g} is not met with {count // 2} rays a bin (error {found.error:.1e}); use fewer bins"
    )
