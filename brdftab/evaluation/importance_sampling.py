"""Importance sampling: draw outgoing directions from a model, and evaluate the density they are drawn with."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdftab import models
from brdftab.directions import HORIZON
from brdftab.errors import ParameterError, SingularDirectionError
from brdftab.evaluation import delta
from brdftab.evaluation.points import singular
from brdftab.models._shared.sampling.sampling import PDF_TOLERANCE
from brdftab.models.protocols import DrawsDelta, DrawsWalks
from brdftab.models.resolve import Setup, resolve
from brdftab.tables.content import SeveralArrays, same_fields, told
from brdftab.typing import Array


@dataclass(frozen=True, repr=False, eq=False)
class Samples(SeveralArrays):
    """Outgoing directions drawn for one direction of light.

    Attributes
    ----------
    theta_o : ndarray (n,)
        Polar angles, radians; at or above pi/2 only where `valid` is false or the surface transmits.
    phi_o : ndarray (n,)
        Absolute azimuths, radians in [0, 2 pi).
    weight : ndarray (n, C)
        f |cos(theta_o)| / pdf a channel, 0 where `valid` is false; its mean estimates the directional albedo. Of models
        that draw whole walks between facets (smith-multi, smith-walk) it is the walk's throughput. Where `delta` is
        true it is the delta's reflectance over `mass`.
    valid : ndarray (n,) of bool
        False where the drawn path ends below the horizon or exceeds the model's cap of bounces.
    pdf : ndarray (n,)
        1/sr with respect to the solid angle of the outgoing direction, 0 where `valid` is false. Approximate for models
        that draw whole walks, good for multiple importance sampling; the weight does not divide by it. 0 where `delta`
        is true: such a draw has a probability, `mass`, and no density.
    delta : ndarray (n,) of bool
        True where the mirror direction of a flat interface was drawn, which light scattered elsewhere never meets.
    mass : float
        Probability of such a draw; 0 but for flat interfaces. The density integrates to 1 minus it, and minus the share
        of invalid samples.
    """

    theta_o: Array
    phi_o: Array
    weight: Array
    valid: NDArray[np.bool_]
    pdf: Array
    delta: NDArray[np.bool_]
    mass: float = 0.0

    _arrays = "theta_o, phi_o, weight, valid, pdf, delta"

    def __eq__(self, other: object) -> bool:
        return same_fields(self, other, self.__dataclass_fields__)

    __hash__ = None  # type: ignore[assignment]  # its arrays can change

    def __repr__(self) -> str:
        drawn = f"{self.theta_o.size:,} directions, {int(self.valid.sum()):,} of them valid"
        return told(self, drawn, f"{self.weight.shape[-1]} channels", f"mass = {self.mass:.3g}")


def _check_angles(name: str, value: Array, low: float, high: float, valid: str) -> None:
    """Raise `ParameterError` for the first angle that is not finite or out of [low, high]."""
    wrong = ~(np.isfinite(value) & (value >= low) & (value <= high))
    if np.any(wrong):
        first = float(value[wrong].flat[0])
        raise ParameterError.out_of_range(name, first, valid, "angles are in radians")


def sample(model: str, theta_i: float, n: int, *, phi_i: float = 0.0, seed: int = 0, **parameters: Any) -> Samples:
    """Draw `n` outgoing directions of a model, with their weights and densities.

    Parameters
    ----------
    model : str
        Registry name.
    theta_i : float
        Polar angle of the light, radians in [0, pi/2); for surfaces that transmit also in (pi/2, pi].
    n : int
        How many directions, at least 1.
    phi_i : float
        Azimuth of the light, radians; matters to anisotropic models and shifts `phi_o`.
    seed : int
        Seed of NumPy's PCG64: the same seed gives the same samples.
    **parameters
        The model's own, as in `brdftab.evaluate`.

    Returns
    -------
    Samples
        Directions, weights (n, C), validity and densities.

    Raises
    ------
    ParameterError
        If an angle, `n`, `seed` or a parameter of the model is out of range.

    Notes
    -----
    What is drawn for which model: docs/sampling.md.
    """
    light = np.asarray(theta_i, dtype=np.float64)
    azimuth = np.asarray(phi_i, dtype=np.float64)
    for name, value in (("theta_i", light), ("phi_i", azimuth)):
        if value.ndim:
            raise ParameterError(
                f"{name} = array of shape {value.shape} is not one number; call sample once a direction"
            )
    _check_angles("phi_i", azimuth, -np.inf, np.inf, "the finite numbers")
    if int(n) != n or n < 1:
        raise ParameterError.out_of_range("n", n, "the whole numbers >= 1")
    if int(seed) != seed or seed < 0:
        raise ParameterError.out_of_range("seed", seed, "the whole numbers >= 0")
    setup = resolve(model, **parameters)
    if setup.transmits:
        _check_angles("theta_i", light, 0.0, np.pi, "[0, pi]")
        if abs(np.cos(light)) <= HORIZON:
            raise ParameterError.out_of_range("theta_i", float(light), "[0, pi] without pi/2", "no light grazes")
    else:
        _check_angles("theta_i", light, 0.0, np.nextafter(0.5 * np.pi, 0.0), "[0, pi/2)")
    lobe = models.sampler(model)
    rng = np.random.Generator(np.random.PCG64(int(seed)))
    walks = lobe.walk if isinstance(lobe, DrawsWalks) else None
    if walks is not None:
        theta_o, phi_o, valid, weight = walks(setup, float(light), float(azimuth), int(n), rng)
        pairs = (np.full(int(n), light), theta_o, phi_o - float(azimuth), np.full(int(n), azimuth))
        density = np.where(valid, lobe.pdf(setup, *pairs), 0.0)
        return Samples(theta_o, phi_o, weight, valid, density, np.zeros(int(n), dtype=bool))
    theta_o, phi_o, valid = lobe.sample(setup, float(light), float(azimuth), int(n), rng)
    mass = float(_mass(setup, light.reshape(1))[0])
    mirrored = rng.random(theta_o.size) < mass if mass > 0.0 else np.zeros(theta_o.shape, dtype=bool)
    density = np.zeros(theta_o.shape)
    weight = np.zeros((theta_o.size, len(setup.channels)))
    if np.any(mirrored):
        theta_o[mirrored], phi_o[mirrored] = light, np.mod(float(azimuth) + np.pi, 2.0 * np.pi)
        weight[mirrored] = delta.reflectance(setup, light.reshape(1)) / mass
    spread = valid & ~mirrored
    if np.any(spread):
        to, phi = theta_o[spread], phi_o[spread] - float(azimuth)
        pairs = (np.full(to.shape, light), to, phi, np.full(to.shape, azimuth))
        density[spread] = (1.0 - mass) * lobe.pdf(setup, *pairs)
        # the same rule as behind the pdf, so that its error cancels
        f = models.kernel(model).points(setup, *pairs, orders=0, tolerance=PDF_TOLERANCE)[:, 0, :]
        # a density of 0 at a drawn direction can only come from rounding at the edge of its support
        safe = np.where(density[spread] > 0.0, density[spread], np.inf)
        weight[spread] = f * (np.cos(to) / safe)[:, None]
    return Samples(theta_o, phi_o, weight, valid | mirrored, density, mirrored, mass)


def _mass(setup: Setup, theta_i: Array) -> Array:
    """Return the probability (N,) with which light from polar angles (N,) is to take a delta's direction."""
    module = models.sampler(setup.model.name)
    return module.mirror_mass(setup, theta_i) if isinstance(module, DrawsDelta) else np.zeros(theta_i.size)


def pdf(
    model: str, theta_i: ArrayLike, theta_o: ArrayLike, phi: ArrayLike, *, phi_i: ArrayLike = 0.0, **parameters: Any
) -> Array:
    """Evaluate the density that `sample` draws from.

    Parameters
    ----------
    model : str
        Registry name.
    theta_i, theta_o : array_like
        Polar angles of light and view, radians in [0, pi]; at pi/2, and beyond it unless the surface transmits, the
        density is 0.
    phi : array_like
        phi_o - phi_i, radians.
    phi_i : array_like
        Azimuth of the light, radians.
    **parameters
        The model's own, as in `brdftab.evaluate`.

    Returns
    -------
    ndarray
        1/sr with respect to the solid angle of the view direction, of the broadcast shape. It integrates to 1 minus
        the share of invalid samples, and minus the probability (`Samples.mass`) of the mirror direction of a flat
        interface. Approximate for models that draw whole walks (smith-multi, smith-walk).

    Raises
    ------
    ParameterError
        If an angle or a parameter of the model is out of range.
    SingularDirectionError
        If a direction is the mirror direction of a model whose density is infinite there.
    """
    given = {"theta_i": theta_i, "theta_o": theta_o, "phi": phi, "phi_i": phi_i}
    arrays = {name: np.asarray(value, dtype=np.float64) for name, value in given.items()}
    for name in ("theta_i", "theta_o"):
        _check_angles(name, arrays[name], 0.0, np.pi, "[0, pi]")
    for name in ("phi", "phi_i"):
        _check_angles(name, arrays[name], -np.inf, np.inf, "the finite numbers")
    setup = resolve(model, **parameters)
    flat = np.broadcast_arrays(*arrays.values())
    shape = flat[0].shape
    ti, to, dphi, pi_ = (a.flatten() for a in flat)
    if setup.transmits:
        above = (np.abs(np.cos(ti)) > HORIZON) & (np.abs(np.cos(to)) > HORIZON)
    else:
        above = (ti < 0.5 * np.pi) & (to < 0.5 * np.pi)
    out = np.zeros(ti.shape)
    if np.any(above):
        pairs = (ti[above], to[above], dphi[above], pi_[above])
        infinite = singular(setup, *pairs)
        if np.any(infinite):
            at = [math.degrees(a[infinite][0]) for a in pairs[:3]]
            raise SingularDirectionError(
                f"theta_i = {at[0]:g}, theta_o = {at[1]:g}, phi = {at[2]:g} degrees is the mirror direction, where the "
                f"density of {model} is infinite; ask for a direction aside, or set max_bounces = 1"
            )
        out[above] = (1.0 - _mass(setup, ti[above])) * models.sampler(model).pdf(setup, *pairs)
    return out.reshape(shape)
