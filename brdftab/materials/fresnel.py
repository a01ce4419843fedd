"""The Fresnel term that every model takes: what reflects, at which wavelengths, and how these become channels."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from brdftab.errors import ParameterError
from brdftab.materials import formulas, indices, quadrature, spectra

MIRROR, CONDUCTOR, DIELECTRIC, SCHLICK, LAZANYI = range(5)
APPROXIMATIONS = ("exact", "schlick", "lazanyi")
LUMINANCE = ("Y",)


@dataclass(frozen=True, eq=False)
class Fresnel:
    """A Fresnel term at W wavelengths (or channels) and its projection to C channels.

    Attributes
    ----------
    kind : int
        0 mirror (F = 1), 1 conductor (a = eta, b = k), 2 dielectric (a = ior), 3 Schlick (a = f0),
        4 Lazányi and Szirmay-Kalos (a = f0, b = factor of the dip's term).
    a, b : float64 (W,)
        One entry a wavelength or channel; `b` is zero where unused.
    weights : float64 (W, C)
        Channel c is ``sum_w weights[w, c] prod_j F_w(cos_j)``: the projection acts after the product over bounces.
    channels : tuple of str
        ``("R", "G", "B")``, ``("Y",)`` or ``("450nm", "550nm", ...)``.
    wavelengths : tuple of float
        In nm; empty where the entries are channels.
    spectral_error : float
        Stated error of this wavelength count against the 5 nm reference, relative to the largest channel, for
        products of up to 8 terms; 0 where no spectrum is projected.
    source : str
        Where the numbers come from.
    """

    kind: int
    a: np.ndarray
    b: np.ndarray
    weights: np.ndarray
    channels: tuple[str, ...]
    wavelengths: tuple[float, ...] = ()
    spectral_error: float = 0.0
    source: str = ""


def _values(name: str, values: ArrayLike, low: float, high: float, valid: str, *, open_low: bool = False) -> np.ndarray:
    """Return `values` as float64 (W,), each finite and in [low, high] (or above low), else raise `ParameterError`."""
    try:
        numbers = np.atleast_1d(np.array(values, dtype=np.float64))
    except (TypeError, ValueError) as error:
        raise ParameterError(f"{name} = {values!r} is not a number or a list of numbers; give {valid}") from error
    if numbers.ndim != 1 or numbers.size == 0:
        raise ParameterError(f"{name} of shape {numbers.shape} is not one value or a list of values; give {valid}")
    above = numbers > low if open_low else numbers >= low
    wrong = ~(np.isfinite(numbers) & above & (numbers <= high))
    if wrong.any():
        raise ParameterError.out_of_range(name, f"{numbers[wrong][0]:g}", valid, "give one value or one a channel")
    return numbers


def _nanometres(wavelengths: ArrayLike) -> np.ndarray:
    """Return wavelengths in nm as float64 (W,): positive, strictly increasing and with distinct channel names."""
    nm = _values("wavelengths", wavelengths, 0.0, np.inf, "positive numbers in nm", open_low=True)
    if len(set(_labels(nm))) < len(nm) or (np.diff(nm) <= 0.0).any():
        raise ParameterError(f"wavelengths = {_join(nm)} are not strictly increasing; sort them and drop repeated ones")
    return nm


def _join(numbers: np.ndarray) -> str:
    """Return numbers as text, the middle left out of long lists."""
    shown = [f"{number:g}" for number in numbers]
    return ",".join(shown if len(shown) <= 8 else [*shown[:4], "...", *shown[-2:]])


def _labels(nm: np.ndarray) -> tuple[str, ...]:
    return tuple(f"{number:g}nm" for number in nm)


def _build(kind: int, named: dict[str, np.ndarray], wavelengths: ArrayLike | None, source: str) -> Fresnel:
    """Settle counts and channels of one or two parameters and build the term with weights identity."""
    nm = None if wavelengths is None else _nanometres(wavelengths)
    count = len(nm) if nm is not None else max(map(len, named.values()))
    for name, values in named.items():
        if len(values) not in (1, count):
            raise ParameterError(
                f"{name} has {len(values)} values where {count} are needed; give one value or {count}, "
                + ("one a wavelength" if nm is not None else "the same count for every parameter")
            )
    if nm is None and count not in (1, 3):
        name = next(iter(named))
        raise ParameterError(f"{name} has {count} values; give 1 (Y) or 3 (R,G,B), or give wavelengths too")
    full = [np.broadcast_to(values, count).copy() for values in named.values()]
    a, b = full if len(full) == 2 else (full[0], np.zeros(count))
    channels = _labels(nm) if nm is not None else (LUMINANCE if count == 1 else spectra.CHANNELS)
    return Fresnel(kind, a, b, np.eye(count), channels, () if nm is None else tuple(nm.tolist()), 0.0, source)


def mirror() -> Fresnel:
    """Return the perfect mirror: F = 1 in one channel ``Y``."""
    return _build(MIRROR, {"mirror": np.ones(1)}, None, "perfect mirror, F = 1")


def metal(name: str, samples: int | None = None, wavelengths: ArrayLike | None = None) -> Fresnel:
    """Return a tabulated material, projected to linear sRGB under D65 or at given wavelengths.

    Parameters
    ----------
    name : str
        One of `indices.names`.
    samples : int, optional
        Number of wavelengths of the projection; by default the fewest whose stated error is at most 1e-5.
    wavelengths : array_like (W,), optional
        In nm, increasing, inside the data: one channel a wavelength ("450nm") instead of R, G, B.

    Returns
    -------
    Fresnel
        Of the kind conductor. Channels may exceed 1 or be negative (outside the sRGB gamut); they are not clamped.

    Raises
    ------
    ParameterError
        If the name is unknown, the count has no rule, a wavelength is outside the data, or both options are given.
    """
    head = indices.header(name)
    source = f"{name}: {head['source']}; {head['licence']}"
    if wavelengths is not None:
        if samples is not None:
            raise ParameterError(f"samples = {samples} does not go with wavelengths; leave one of them out")
        nm = _nanometres(wavelengths)
        eta, k = indices.at(name, nm)
        return _build(CONDUCTOR, {"eta": eta, "k": k}, nm, source)
    rule = quadrature.rule(name, samples)
    eta, k = indices.at(name, rule.wavelengths)
    nodes = tuple(rule.wavelengths.tolist())
    return Fresnel(CONDUCTOR, eta, k, rule.weights.copy(), spectra.CHANNELS, nodes, rule.error, source)


def conductor(eta: ArrayLike, k: ArrayLike, wavelengths: ArrayLike | None = None) -> Fresnel:
    """Return a conductor of given complex index ``eta + ik``.

    Parameters
    ----------
    eta, k : array_like
        Real part (> 0) and extinction coefficient (>= 0): one value (channel Y), three (R, G, B), or one a wavelength.
        One value beside several is taken for all.
    wavelengths : array_like (W,), optional
        In nm, increasing; the channels are then "450nm", ...

    Raises
    ------
    ParameterError
        If a value is out of range or not finite, or the counts do not go together.
    """
    named = {
        "eta": _values("eta", eta, 0.0, np.inf, "positive numbers", open_low=True),
        "k": _values("k", k, 0.0, np.inf, "[0, inf)"),
    }
    return _build(CONDUCTOR, named, wavelengths, "eta and k given by the user")


def dielectric(ior: ArrayLike, wavelengths: ArrayLike | None = None) -> Fresnel:
    """Return a dielectric of relative index `ior` >= 1, counts as in `conductor`; raises `ParameterError`."""
    named = {"ior": _values("ior", ior, 1.0, np.inf, "[1, inf)")}
    return _build(DIELECTRIC, named, wavelengths, "ior given by the user")


def schlick(f0: ArrayLike, wavelengths: ArrayLike | None = None) -> Fresnel:
    """Return Schlick's approximation from `f0` in [0, 1], counts as in `conductor`; raises `ParameterError`."""
    named = {"f0": _values("f0", f0, 0.0, 1.0, "[0, 1]")}
    return _build(SCHLICK, named, wavelengths, "f0 given by the user")


def lazanyi(eta: ArrayLike, k: ArrayLike, wavelengths: ArrayLike | None = None) -> Fresnel:
    """Return Lazányi and Szirmay-Kalos' approximation of a conductor, arguments as in `conductor`.

    F = f0 + (1 - f0)(1 - c)^5 - b c (1 - c)^6 with f0 exact and b fitted to the metal; raises `ParameterError`.
    """
    return approximated(conductor(eta, k, wavelengths), "lazanyi")


def approximated(exact: Fresnel, how: str) -> Fresnel:
    """Return an approximation of an exact term at the same wavelengths with the same projection.

    Parameters
    ----------
    exact : Fresnel
        Conductor or dielectric; a mirror or an approximation is returned as it is.
    how : {"exact", "schlick", "lazanyi"}
        ``exact`` returns the term itself; ``lazanyi`` of a dielectric takes it for a conductor with k = 0.

    Raises
    ------
    ParameterError
        If there is no such approximation.
    """
    if how not in APPROXIMATIONS:
        raise ParameterError.not_known("fresnel", how, APPROXIMATIONS)
    if how == "exact" or exact.kind not in (CONDUCTOR, DIELECTRIC):
        return exact
    f0 = formulas.conductor(exact.a, exact.b, 1.0)
    if how == "schlick":
        return replace(exact, kind=SCHLICK, a=f0, b=np.zeros_like(f0), source=f"{exact.source}; Schlick")
    dip = formulas.lazanyi_dip(exact.a, exact.b)
    return replace(exact, kind=LAZANYI, a=f0, b=dip, source=f"{exact.source}; Lazányi and Szirmay-Kalos")


def reflectance(fresnel: Fresnel, cos: ArrayLike) -> np.ndarray:
    """Return F at each wavelength, unprojected: the plain reference of the compiled version.

    Parameters
    ----------
    fresnel : Fresnel
        The term.
    cos : array_like (...)
        Cosine of the angle of incidence, clipped to [0, 1].

    Returns
    -------
    float64 (..., W)
        In [0, 1]; multiply over bounces, then project with ``@ fresnel.weights``.
    """
    c = np.asarray(cos, dtype=np.float64)[..., None]
    if fresnel.kind == CONDUCTOR:
        return formulas.conductor(fresnel.a, fresnel.b, c)
    if fresnel.kind == DIELECTRIC:
        return formulas.dielectric(fresnel.a, c)
    if fresnel.kind == SCHLICK:
        return formulas.schlick(fresnel.a, c)
    if fresnel.kind == LAZANYI:
        return formulas.lazanyi(fresnel.a, fresnel.b, c)
    return np.ones((*c.shape[:-1], len(fresnel.a)))
