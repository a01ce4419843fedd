"""From what the user gave to a validated, canonical setup that kernels can run with."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from brdftab.errors import ParameterError
from brdftab.materials import fresnel as builders
from brdftab.materials.fresnel import Fresnel
from brdftab.models import spec, validated
from brdftab.models._shared.codes import NDF_CODES
from brdftab.models.declaration import Model, Param

# of linear sRGB, IEC 61966-2-1
LUMINANCE = (0.2126, 0.7152, 0.0722)


@dataclass(frozen=True)
class Setup:
    """A model with checked parameters.

    Attributes
    ----------
    model : Model
        The declaration.
    parameters : dict
        Canonical parameters, JSON-able; `resolve(model.name, **parameters)` gives the same setup back.
    channels : tuple of str
        Names of the output channels.
    fresnel : Fresnel or None
        Reflectance of a facet; None for diffuse models.
    ndf : int
        0 Beckmann, 1 GGX, 2 Phong, 3 Gaussian in the tilt, -1 none.
    alpha_x, alpha_y : float
        Roughness along both axes (equal if isotropic); sigma_x and sigma_y of models that name it so.
    values : dict
        The remaining parameters, arrays where a channel each.
    max_bounces : int or None
        Cap of the bounce orders.
    """

    model: Model
    parameters: dict[str, Any]
    channels: tuple[str, ...]
    fresnel: Fresnel | None = None
    ndf: int = -1
    alpha_x: float = 1.0
    alpha_y: float = 1.0
    values: dict[str, Any] = field(default_factory=dict)
    max_bounces: int | None = None

    @property
    def transmits(self) -> bool:
        """True for a dielectric surface that lets light through."""
        return self.model.transmits and self.fresnel is not None and self.fresnel.kind == builders.DIELECTRIC

    @property
    def kinked(self) -> bool:
        """True where the masking sets in with an edge, see `Model`."""
        return self.model.kinked and not any(self.values.get(n) == word for n, word in self.model.unkinked.items())

    @property
    def isotropic(self) -> bool:
        """True when the BRDF depends on phi_o - phi_i only."""
        return self.alpha_x == self.alpha_y and not self.model.grain


def _floats(param: Param, value: Any) -> Any:
    """Check one number or a sequence of numbers against the declared bounds."""
    try:
        array = np.atleast_1d(np.asarray(value, dtype=np.float64))
    except (TypeError, ValueError):
        array = np.array([np.nan])
    lo, hi = param.bounds or (-math.inf, math.inf)
    shown_lo, shown_hi = lo, hi
    if param.unit == "rad":
        shown_lo, shown_hi = round(math.degrees(lo), 9), round(math.degrees(hi), 9)
    valid = f"[{shown_lo:g}, {shown_hi:g}]" + (" degrees" if param.unit == "rad" else f" {param.unit}".rstrip())
    many = param.kind == "channels"
    if array.ndim != 1 or array.size == 0 or (array.size != 1 and not many):
        raise ParameterError(
            f"{param.name} = {value!r} is not {'a list of numbers' if many else 'one number'} in {valid}"
        )
    for x in array:
        if not (math.isfinite(x) and lo <= x <= hi):
            shown = f"{math.degrees(x):g} degrees" if param.unit == "rad" else f"{x:g}"
            raise ParameterError.out_of_range(param.name, shown, valid, param.remark or param.doc)
    if param.kind == "int":
        if array[0] != int(array[0]):
            raise ParameterError.out_of_range(param.name, value, f"the whole numbers in {valid}")
        return int(array[0])
    return [float(x) for x in array] if many else float(array[0])


def _checked(param: Param, value: Any) -> Any:
    """Return a JSON-able, validated value of one parameter."""
    if param.kind == "choice":
        choices, called = param.choices, None
        if param.name == "material" and param.role == "optics":
            from brdftab.materials.indices import called as spoken
            from brdftab.materials.indices import names

            choices = ("mirror", *names())
            called = None if value in choices else spoken()
        if isinstance(value, int | float) and str(value) in choices:
            # bounces = 2 means "2"
            value = str(value)
        if value not in choices:
            why = f" ({param.remark})" if param.remark else ""
            raise ParameterError.not_known(param.name, value, choices, why, called)
        return value
    if param.kind == "text":
        if not (isinstance(value, str) and value):
            raise ParameterError(f"{param.name} = {value!r} is not a word; give {param.doc}")
        return value
    return _floats(param, value)


def _fresnel(given: Mapping[str, Any], model: Model) -> Fresnel:
    """Build the reflectance from exactly one of material, eta + k, ior, f0."""
    given = {n: v for n, v in given.items() if model.shares(n)}
    sources = [s for s in ("material", "eta", "ior", "f0") if given.get(s) is not None]
    if given.get("k") is not None and given.get("eta") is None:
        raise ParameterError("k needs eta beside it; give both, or a material by name")
    if given.get("eta") is not None and given.get("k") is None:
        raise ParameterError("eta needs k beside it; give both, or --ior for a dielectric")
    if len(sources) > 1:
        raise ParameterError(f"{' and '.join(sources)} exclude each other; give one source of the Fresnel reflectance")
    source = sources[0] if sources else "material"
    waves = given.get("wavelengths")
    samples = given.get("spectral_samples")
    if source != "material" or given.get("material") == "mirror":
        if samples is not None:
            raise ParameterError(f"spectral_samples = {samples} needs a metal by name; leave it out")
        if waves is not None and source != "eta":
            raise ParameterError("wavelengths need a metal by name or eta and k; leave them out")
    if waves is not None and samples is not None:
        raise ParameterError("wavelengths and spectral_samples exclude each other; give one of them")
    if source == "eta":
        return builders.conductor(given["eta"], given["k"], wavelengths=waves)
    if source == "ior":
        return builders.dielectric(given["ior"])
    if source == "f0":
        return builders.schlick(given["f0"])
    material = given.get("material") or model.param("material").default
    if material == "mirror":
        return builders.mirror()
    try:
        return builders.metal(material, samples=samples, wavelengths=waves)
    except ParameterError as error:
        # the builder knows this parameter by its short name
        text = str(error)
        raise ParameterError(f"spectral_{text}" if text.startswith("samples") else text) from None


def _roughness(given: dict[str, Any], model: Model) -> tuple[int, float, float]:
    """Return the distribution's code and both roughnesses; fill in the canonical parameters."""
    ndf = given.setdefault("ndf", model.param("ndf").default)
    one = model.roughness
    names = (f"{one}_x", f"{one}_y", one, "exponent")
    ax, ay, alpha, exponent = (given.get(n) if model.shares(n) else None for n in names)
    if (ax is None) != (ay is None):
        raise ParameterError(f"{one}_x and {one}_y go together; give both, or {one} alone")
    if sum(x is not None for x in (ax, alpha, exponent)) > 1:
        more = " and exponent" if model.shares("exponent") else ""
        raise ParameterError(f"{one}, {one}_x with {one}_y{more} exclude each other; give one of them")
    if exponent is not None and ndf != "phong":
        raise ParameterError(f"exponent = {exponent:g} needs ndf = phong, not {ndf}; give {one}")
    if ax is not None and ndf in ("phong", "gaussian") and ax != ay:
        raise ParameterError(f"{one}_x = {ax:g}, {one}_y = {ay:g}: ndf = {ndf} is isotropic; give {one}")
    if exponent is not None:
        ax = ay = math.sqrt(2.0 / (exponent + 2.0))
    elif ax is None or ay is None:
        ax = ay = given.setdefault(one, model.param(one).default)
    if (ax == 0.0) != (ay == 0.0):
        raise ParameterError(f"{one}_x = {ax:g}, {one}_y = {ay:g}: only both together may be 0; give {one} = 0")
    return NDF_CODES[ndf], float(ax), float(ay)


def _interface(given: dict[str, Any], model: Model) -> Fresnel:
    """Build the dielectric of a model with a matte body from ior or f0; one channel or three with kd."""
    if given.get("ior") is not None and given.get("f0") is not None:
        raise ParameterError("ior and f0 exclude each other; give one of them")
    if given.get("f0") is not None:
        root = np.sqrt(np.array(given["f0"]))
        fresnel = builders.dielectric((1.0 + root) / (1.0 - root))
    else:
        fresnel = builders.dielectric(given.setdefault("ior", _checked(model.param("ior"), model.param("ior").default)))
    return fresnel


def resolve(model: str, **given: Any) -> Setup:
    """Check parameters against a model's declaration.

    Parameters
    ----------
    model : str
        Registry name.
    **given
        Parameters by API name; ``None`` means not given. Angles in radians.

    Returns
    -------
    Setup
        The checked setup.

    Raises
    ------
    ParameterError
        If the model is unknown, or a parameter is unknown, out of range, or excluded by another one.
    """
    declared = spec(model)
    checked: dict[str, Any] = {}
    for name, value in given.items():
        param = declared.param(name)
        if value is not None:
            checked[name] = _checked(param, value)
    values: dict[str, Any] = {}
    fresnel: Fresnel | None = None
    ndf, ax, ay = -1, 1.0, 1.0
    channels: tuple[str, ...] = ("Y",)
    if declared.ndfs:
        ndf, ax, ay = _roughness(checked, declared)
    if declared.shares("material"):
        fresnel = _fresnel(checked, declared)
        if not any(checked.get(s) is not None for s in ("material", "eta", "ior", "f0")):
            checked["material"] = declared.param("material").default
    elif declared.shares("ior"):
        fresnel = _interface(checked, declared)
    if fresnel is not None:
        channels = fresnel.channels
    for param in declared.params:
        if param.role in ("optics", "roughness"):
            continue
        if param.default is not None and param.name not in checked:
            checked[param.name] = _checked(param, param.default)
        value = checked.get(param.name)
        values[param.name] = np.array(value) if param.kind == "channels" else value
    if declared.shares("kd"):
        count = len(checked["kd"])
        if count not in (1, 3):
            raise ParameterError(f"kd has {count} values; give one, or three (R, G, B)")
        if fresnel is None or count == 3:
            channels = ("Y",) if count == 1 else ("R", "G", "B")
    order = [p.name for p in declared.params]
    parameters = {n: (v[0] if isinstance(v, list) and len(v) == 1 else v) for n, v in checked.items()}
    setup = Setup(
        model=declared,
        parameters=dict(sorted(parameters.items(), key=lambda item: order.index(item[0]))),
        channels=channels,
        fresnel=fresnel,
        ndf=ndf,
        alpha_x=ax,
        alpha_y=ay,
        values=values,
        max_bounces=values["max_bounces"] if declared.shares("max_bounces") else None,
    )
    return validated(setup)


def luminance(setup: Setup) -> Setup:
    """Return a setup with one channel Y, the luminance of linear sRGB, where the spectrum alone makes its channels.

    Others come back as they are: their RGB values are added up after the evaluation (`LUMINANCE`).
    """
    fresnel = setup.fresnel
    coloured = any(np.asarray(setup.values.get(p.name)).size > 1 for p in setup.model.params if p.kind == "channels")
    if fresnel is None or coloured or not setup.channels == fresnel.channels == ("R", "G", "B"):
        return setup
    weights = fresnel.weights @ np.array(LUMINANCE)[:, None]
    return replace(setup, fresnel=replace(fresnel, weights=weights, channels=("Y",)), channels=("Y",))


def component_names(setup: Setup, orders: int) -> tuple[str, ...]:
    """Return the component names of a setup; bounce models have `orders` of them and one for the rest if uncapped."""
    if setup.model.components != ("order",):
        return tuple(c for c in setup.model.components if c != "interreflection" or setup.max_bounces != 1)
    named = tuple(f"order{k}" for k in range(1, orders + 1))
    if setup.max_bounces is not None and setup.max_bounces <= orders:
        return named[: setup.max_bounces]
    return (*named, "higher")
