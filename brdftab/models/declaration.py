"""What a model declares about itself: its parameters, and what holds for all of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from brdftab.errors import ParameterError, proposal


@dataclass(frozen=True)
class Param:
    """One parameter of a model, declared once and used by the API, the command line and the docs.

    Attributes
    ----------
    name : str
        Name in the API; the option is ``--name`` with dashes.
    unit : str
        ``""`` for pure numbers, ``"rad"`` for angles (degrees on the command line).
    default : object
        Value taken when the user gives none; ``None`` means not set.
    bounds : tuple of float or None
        Inclusive lower and upper bound of every entry.
    doc : str
        One line for ``--help`` and ``brdftab models``.
    kind : {"float", "channels", "choice", "int", "text"}
        ``channels`` takes one value or one a channel; ``choice`` takes one of `choices`; ``text`` is read by the
        model's own ``validate_setup``.
    choices : tuple of str
        Allowed words of a ``choice``.
    remark : str
        What an error about this parameter adds: why a value is left out, or what to do instead.
    role : {"", "albedo", "bounces", "optics", "paths", "roughness", "tilt"}
        What it is to all that serves models without knowing them: the albedo of a matte body; a cap of the bounces;
        what facets reflect; how an estimator draws its paths; the distribution of facets and its width; the deviation
        of facets' tilt (radians). Without a role a name means nothing but the model's own.
    scale : {"linear", "log"}
        What a fit moves: the number, or its logarithm.
    shared : bool
        True where a fit finds one value for all channels of a ``channels``.
    canonical : tuple of str
        What it is called among the numbers of a twin; by default as here.
    start : tuple of float or None
        Range that real surfaces fill, in which fits start; by default that of the role, or the bounds.
    extremes : tuple of float
        Values within the bounds at which the checks look beside the bounds: nothing, almost nothing, far too much.
    neutral : float or None
        Value at which its lobe is gone, which a scene may leave out.
    """

    name: str
    unit: str
    default: Any
    bounds: tuple[float, float] | None
    doc: str
    kind: str = "float"
    choices: tuple[str, ...] = ()
    remark: str = ""
    role: str = ""
    scale: str = "linear"
    shared: bool = False
    canonical: tuple[str, ...] = ()
    start: tuple[float, float] | None = None
    extremes: tuple[float, ...] = ()
    neutral: float | None = None


@dataclass(frozen=True)
class Model:
    """What a model says of itself.

    Attributes
    ----------
    name, title, summary : str
        Registry name, full name, one line.
    params : tuple of Param
        Its parameters.
    components : tuple of str
        Named components; ``("order",)`` means one a bounce order.
    singular : bool
        True where the density is infinite at the mirror direction, so that a cell there holds an average.
    kinked : bool
        True where the masking of a V-cavity sets in with an edge, so that tables
        to be interpolated are looked at more closely.
    unkinked : mapping
        Words of choices with which a kinked model has no such edge.
    multibounce : bool
        True where ``max_bounces`` applies.
    citation, doi : str
        The paper.
    variant, errata : str
        Which formula was chosen and which misprints were mended, and why.
    ndfs : tuple of str
        Normal distributions that the model takes; empty for models without facets.
    reciprocal : bool
        False where swapping light and view changes the value, so that no half of a grid follows from the other.
    transmits : bool
        True where a dielectric (ior) sends light through the surface, so that directions below it count.
    grain : bool
        True where the surface has a direction of its own, azimuth 0, so that azimuths count one by one.
    forms : tuple of str
        Files of its own kind that ``tabulate --form`` writes, the first by default; empty for tables alone.
    roughness : str
        Name of the roughness parameter; its anisotropic pair ends in ``_x`` and ``_y``.
    methods : mapping
        Of a parameter, the values that compute the same more roughly, or in the paper's short form.
    approximates : mapping
        Of a model that this one stands for, those of its parameters that this one does without.
    golden : mapping
        Parameters that keep golden tables cheap.
    """

    name: str
    title: str
    summary: str
    params: tuple[Param, ...]
    components: tuple[str, ...]
    citation: str
    doi: str
    variant: str
    errata: str = ""
    singular: bool = False
    kinked: bool = False
    unkinked: Mapping[str, str] = field(default_factory=dict)
    multibounce: bool = False
    transmits: bool = False
    reciprocal: bool = True
    grain: bool = False
    ndfs: tuple[str, ...] = field(default=())
    forms: tuple[str, ...] = field(default=())
    roughness: str = "alpha"
    methods: Mapping[str, tuple[Any, ...]] = field(default_factory=dict)
    approximates: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    golden: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Refuse names that a twin's numbers have: ``a`` and ``b`` of a reflectance, both roughnesses, nodes."""
        taken = {"nodes", "prepared"}
        taken |= {"a", "b"} if self.of_role("optics") else set()
        taken |= {"alpha_x", "alpha_y"} if self.ndfs else set()
        clash = [p.name for p in self.params if p.name in taken and not p.role]
        if clash:
            raise ValueError(f"{clash[0]} of model {self.name} is what twins call something else; choose another name")

    def __repr__(self) -> str:
        return f"Model({self.name}: {self.title}, {len(self.params)} parameters)"

    def has(self, name: str) -> bool:
        """Tell whether the model declares a parameter of that name."""
        return any(p.name == name for p in self.params)

    def shares(self, name: str) -> bool:
        """Tell whether the model declares a parameter of that name with the meaning that all models give to it."""
        return any(p.name == name and p.role for p in self.params)

    def of_role(self, role: str) -> tuple[str, ...]:
        """Return the names of the parameters of one role."""
        return tuple(p.name for p in self.params if p.role == role)

    def param(self, name: str) -> Param:
        """Return the declaration of one parameter, or raise `ParameterError`."""
        for p in self.params:
            if p.name == name:
                return p
        known = [p.name for p in self.params]
        near = proposal(name, known)
        raise ParameterError(
            f"{name} is not a parameter of {self.name}; {near}{'I' if near else 'i'}t takes {', '.join(known)}"
        )
