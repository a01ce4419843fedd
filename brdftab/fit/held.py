"""What a fit holds: the choices that data were made with, and every other parameter that is not free."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from brdftab.models.declaration import Model

if TYPE_CHECKING:
    from brdftab.fit.parameters import Term


# what resolves a metal's spectrum
SPECTRUM = ("spectral_samples", "wavelengths")


def of_data(label: str, model: Model, made: Mapping[str, Any]) -> dict[str, Any]:
    """Return the parameters of a model that the data's provenance settles: its choices, as ndf and masking.

    Parameters
    ----------
    label : str
        Of the term, which the parameters of a sum are listed under.
    model : Model
        That is to be fitted; it need not be the one that the data were made with.
    made : mapping
        Provenance; anything else than parameters of models in it is passed over.
    """
    known, found = _parameters(label, made), {}
    for param in model.params:
        value = known.get(param.name)
        # how estimators draw is how a value is computed, not which
        if value is None or param.role == "paths":
            continue
        if param.kind == "choice":
            metal = param.role == "optics" and isinstance(value, str)
            if metal or value in param.choices:
                found[param.name] = value
        # a cap of the bounces changes what is computed, and so does how finely a metal's spectrum is resolved
        elif param.role == "bounces" or (param.name in SPECTRUM and param.role == "optics" and "material" in known):
            found[param.name] = value
    return found


def optics_of_data(label: str, model: Model, made: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the source of reflectance that data were made with, as a fit can free it: ior, f0, or eta and k.

    An index that differs by channel is none of them, for a fit has one for all, nor one that lets light through.
    """
    known = {n: v for n, v in _parameters(label, made).items() if v is not None and model.shares(n)}
    one = not model.transmits and np.unique(np.ravel(known.get("ior", np.nan))).size == 1
    for names in (("ior",), ("f0",), ("eta", "k")):
        if all(n in known for n in names) and (names != ("ior",) or one):
            return names
    return ()


def _parameters(label: str, made: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return the parameters of the term of a label in provenance; empty where there are none."""
    known = made.get("parameters")
    if isinstance(known, Mapping) and any(isinstance(v, Mapping) for v in known.values()):
        known = known.get(label)
    return known if isinstance(known, Mapping) else {}


def held(term: Term, values: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, str]]:
    """Return every parameter of a term that is not free, and where each comes from: user, file or default.

    Parameters
    ----------
    term : Term
    values : mapping
        The free parameters, one number each.
    """
    parameters = {n: v for n, v in term.setup(values).parameters.items() if n not in term.free and v is not None}
    given = {n: v for n, v in term.fixed.items() if v is not None}
    parameters = {**given, **parameters}
    return parameters, {n: "file" if n in term.carried else "user" if n in given else "default" for n in parameters}
