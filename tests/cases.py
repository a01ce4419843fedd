"""One table of cases with values that are known exactly or were computed by independent means.

Angles are degrees, values 1/sr without cosine. Tests iterate `CASES`; `test_cases.py` tests the table itself.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

PI = math.pi
TAGS = {"closed", "reference", "horizon", "fresnel", "anisotropic", "components", "colour"}
FOLDER = Path(__file__).parent / "reference"
REFERENCE = json.loads((FOLDER / "vgroove.json").read_text())["points"]
INTERFACED = json.loads((FOLDER / "ilm.json").read_text())["points"]


@dataclass(frozen=True)
class Case:
    """A model at one pair of directions with the value it must have.

    `parts` holds components that must come out too; rtol has an absolute floor of 1e-12/sr.
    """

    name: str
    model: str
    parameters: dict[str, Any]
    angles: tuple[float, float, float]
    value: tuple[float, ...]
    source: str
    phi_i: float = 0.0
    parts: dict[str, tuple[float, ...]] = field(default_factory=dict)
    rtol: float = 1e-12
    tags: frozenset[str] = frozenset({"closed"})


def _smith_ggx(alpha: float, theta_i: float, theta_o: float) -> float:
    """Write out D G2/(4 cos cos) of height-correlated GGX in the plane of incidence, retro side (phi = 0)."""
    ti, to = math.radians(theta_i), math.radians(theta_o)
    tilt = math.tan(0.5 * (ti + to))
    d = 1.0 / (PI * alpha**2 * math.cos(0.5 * (ti + to)) ** 4 * (1.0 + (tilt / alpha) ** 2) ** 2)
    lambdas = [0.5 * (math.sqrt(1.0 + (alpha * math.tan(t)) ** 2) - 1.0) for t in (ti, to)]
    return d / (1.0 + sum(lambdas)) / (4.0 * math.cos(ti) * math.cos(to))


def _qualitative(kd: float, sigma: float, theta_i: float, theta_o: float, phi: float) -> float:
    """Write out Oren and Nayar's Eq. 30; degrees."""
    ti, to, p, s2 = math.radians(theta_i), math.radians(theta_o), math.radians(phi), math.radians(sigma) ** 2
    a, b = 1.0 - 0.5 * s2 / (s2 + 0.33), 0.45 * s2 / (s2 + 0.09)
    return kd / PI * (a + b * max(0.0, math.cos(p)) * math.sin(max(ti, to)) * math.tan(min(ti, to)))


def _phong(nu: float, nv: float, angles: tuple[float, float, float], phi_i: float, f0: float) -> tuple[float, float]:
    """Write out Eqs. 4 and 5 of Ashikhmin and Shirley with vectors: highlight, and base of kd = 1; degrees."""
    ti, to, pi, po = (math.radians(a) for a in (*angles[:2], phi_i, phi_i + angles[2]))
    k1, k2 = ([math.sin(t) * math.cos(p), math.sin(t) * math.sin(p), math.cos(t)] for t, p in ((ti, pi), (to, po)))
    half = [a + b for a, b in zip(k1, k2, strict=True)]
    x, y, z = (c / math.hypot(*half) for c in half)
    k_h = k1[0] * x + k1[1] * y + k1[2] * z
    lobe = math.sqrt((nu + 1.0) * (nv + 1.0)) / (8.0 * PI) * z ** ((nu * x * x + nv * y * y) / (1.0 - z * z))
    fresnel = f0 + (1.0 - f0) * (1.0 - k_h) ** 5
    matte = 28.0 / (23.0 * PI) * (1.0 - f0) * (1.0 - (1.0 - 0.5 * k1[2]) ** 5) * (1.0 - (1.0 - 0.5 * k2[2]) ** 5)
    return lobe * fresnel / (k_h * max(k1[2], k2[2])), matte


def _mirrors() -> list[Case]:
    """Return a flat scratch: all light of a bin of the angle across leaves by the mirrored bin, blurred along."""
    bins, psi = 32, math.radians(2.0)
    found = []
    for t, j in ((20.0, 25), (-50.0, 9), (0.0, 16)):
        p, along = PI * ((j + 0.5) / bins - 0.5), math.radians(t)
        share = math.sin(PI * ((j + 1) / bins - 0.5)) - math.sin(PI * (j / bins - 0.5))
        theta = math.acos(math.cos(along) * math.cos(p))
        light = math.atan2(math.cos(along) * math.sin(p), math.sin(along))
        blur = 15.0 / (16.0 * psi)
        # the whole cone: int 15/16 (1 - x^2)^2 cos(psi x) dx
        whole = 1.0 - psi**2 / 14.0 + psi**4 / 504.0
        value = blur / (share * math.cos(along) ** 2 * whole)
        angles = (math.degrees(theta), math.degrees(theta), 180.0)
        given = {"profile": "flat", "bins": bins, "psi": psi, "material": "mirror"}
        found.append(
            Case(
                f"scratch flat {t:g} {j}", "scratch", given, angles, (value,), "a mirror in bins",
                math.degrees(light), rtol=1e-8, tags=frozenset({"closed", "anisotropic"}),
            )
        )  # fmt: skip
    return found


def _highlights() -> list[Case]:
    """Return the anisotropic Phong model in and off the plane of incidence, with and without a base."""
    found = []
    for nu, nv, angles, phi_i, f0, kd in (
        (200.0, 20.0, (30.0, 50.0, 170.0), 25.0, 0.04, 0.0),
        (1e4, 2.0, (60.0, 20.0, 120.0), 80.0, 0.9, 0.3),
        (3.0, 3.0, (80.0, 85.0, 150.0), 200.0, 0.5, 1.0),
        (0.0, 1000.0, (10.0, 5.0, 40.0), -60.0, 0.0, 0.7),
    ):
        specular, diffuse = _phong(nu, nv, angles, phi_i, f0)
        found.append(
            Case(
                f"ashikhmin-shirley {nu:g} {nv:g}", "ashikhmin-shirley", {"nu": nu, "nv": nv, "f0": f0, "kd": kd},
                angles, (specular + kd * diffuse,), "Eqs. 4 and 5", phi_i,
                {"specular": (specular,), "diffuse": (kd * diffuse,)},
                tags=frozenset({"closed", "anisotropic", "components"}),
            )
        )  # fmt: skip
    return found


def _conductor(n: float, k: float) -> float:
    return ((n - 1.0) ** 2 + k * k) / ((n + 1.0) ** 2 + k * k)


def _references() -> list[Case]:
    """Return the points of reference/vgroove.json, verified there by two independent methods."""
    found = []
    for number, point in enumerate(REFERENCE):
        rough = {"alpha": point["alpha_x"]}
        anisotropic = point["alpha_x"] != point["alpha_y"]
        if anisotropic:
            rough = {"alpha_x": point["alpha_x"], "alpha_y": point["alpha_y"]}
        found.append(
            Case(
                name=f"{point['model']} reference {number}",
                model=point["model"],
                parameters={"ndf": point["ndf"], **rough, "material": "mirror"},
                angles=(point["theta_i_deg"], point["theta_o_deg"], point["phi_o_deg"] - point["phi_i_deg"]),
                phi_i=point["phi_i_deg"],
                value=(point["total"],),
                parts={f"order{k}": (value,) for k, value in enumerate(point["orders"], start=1)},
                source="reference/vgroove.json",
                rtol=1e-7,
                tags=frozenset({"reference", "components"} | ({"anisotropic"} if anisotropic else set())),
            )
        )
    return found


def _interfaced() -> list[Case]:
    """Return the points of reference/ilm.json, verified there by refined quadrature and a midpoint rule."""
    names = {"ndf", "masking", "sigma", "ior", "kd"}
    return [
        Case(
            name=f"ilm reference {number}",
            model="ilm",
            parameters={name: value for name, value in point.items() if name in names},
            angles=(point["theta_i_deg"], point["theta_o_deg"], point["phi_deg"]),
            value=(point["specular"] + point["body"],),
            parts={"specular": (point["specular"],), "body": (point["body"],)},
            source="reference/ilm.json",
            rtol=1e-8,
            tags=frozenset({"reference", "components"}),
        )
        for number, point in enumerate(INTERFACED)
    ]


def _flat_interfaced(kd: float, n: float, theta_i: float, theta_o: float) -> float:
    """Write out Eq. 9 of Meneveaux et al. with Fresnel's amplitudes and Eq. 11; degrees."""

    def transmission(theta: float) -> float:
        c = math.cos(math.radians(theta))
        g = math.sqrt(1.0 - (math.sin(math.radians(theta)) / n) ** 2)
        return 1.0 - 0.5 * (((c - n * g) / (c + n * g)) ** 2 + ((n * c - g) / (n * c + g)) ** 2)

    q, p = n**4 - 1.0, n * n + 1.0
    r_e = 0.5 - 2.0 * n**3 * (n * n + 2.0 * n - 1.0) / (p * q) + (n - 1.0) * (3.0 * n + 1.0) / (6.0 * (n + 1.0) ** 2)
    r_e += 8.0 * n**4 * (n**4 + 1.0) / (p * q * q) * math.log(n)
    r_e += n * n * (n * n - 1.0) ** 2 / p**3 * math.log((n - 1.0) / (n + 1.0))
    r_i = 1.0 - (1.0 - r_e) / n**2
    return transmission(theta_i) * transmission(theta_o) * kd / (PI * n * n * (1.0 - kd * r_i))


# at normal incidence and view D(0) = 1/(pi alpha^2), G = 1: f = F/(4 pi alpha^2)
_AT_NORMAL = 1.0 / (4.0 * PI * 0.25)
_NORMAL = (0.0, 0.0, 0.0)
_GGX = {"ndf": "ggx", "alpha": 0.5}


def _facets(model: str, **more: Any) -> list[Case]:
    """Return what every single-bounce model of facets must give at normal incidence, by source of the reflectance."""
    fresnel: dict[str, tuple[dict[str, Any], tuple[float, ...]]] = {
        "mirror": ({"material": "mirror"}, (1.0,)),
        "dielectric": ({"ior": 1.5}, (0.04,)),
        "Schlick": ({"f0": [0.9, 0.6, 0.3]}, (0.9, 0.6, 0.3)),
        "conductor": ({"eta": 2.91, "k": 3.09}, (_conductor(2.91, 3.09),)),
        "wavelengths": (
            {"eta": [1.5, 0.2], "k": [1.9, 3.5], "wavelengths": [450.0, 650.0]},
            (_conductor(1.5, 1.9), _conductor(0.2, 3.5)),
        ),
    }
    return [
        Case(
            name=f"{model} {word} at normal incidence",
            model=model,
            parameters={**_GGX, **optics, **more},
            angles=_NORMAL,
            value=tuple(_AT_NORMAL * f for f in factors),
            source="D(0) F/4",
            tags=frozenset({"closed", "fresnel"}),
        )
        for word, (optics, factors) in fresnel.items()
    ]


CASES: tuple[Case, ...] = (
    Case("lambert", "lambert", {"kd": 0.3}, (10.0, 70.0, 33.0), (0.3 / PI,), "kd/pi"),
    Case(
        "lambert in colour", "lambert", {"kd": [0.1, 0.2, 1.0]}, (80.0, 0.0, 180.0), (0.1 / PI, 0.2 / PI, 1.0 / PI),
        "kd/pi", tags=frozenset({"closed", "colour"}),
    ),
    Case("lambert seen from below", "lambert", {}, (10.0, 91.0, 0.0), (0.0,), "horizon", tags=frozenset({"horizon"})),
    Case(
        "oren-nayar without tilt", "oren-nayar", {"kd": 0.5, "sigma": 0.0}, (50.0, 60.0, 20.0), (0.5 / PI,),
        "Eqs. 27-29",
    ),
    Case(
        "oren-nayar qualitative, retro", "oren-nayar",
        {"kd": 0.9, "sigma": math.radians(30.0), "variant": "qualitative"},
        (60.0, 40.0, 25.0), (_qualitative(0.9, 30.0, 60.0, 40.0, 25.0),), "Eq. 30",
    ),
    Case(
        "oren-nayar qualitative, forward", "oren-nayar",
        {"kd": 0.9, "sigma": math.radians(30.0), "variant": "qualitative"},
        (60.0, 40.0, 150.0), (_qualitative(0.9, 30.0, 60.0, 40.0, 150.0),), "Eq. 30",
    ),
    Case(
        "smith GGX, retro side", "smith", {"ndf": "ggx", "alpha": 0.3, "material": "mirror"},
        (20.0, 55.0, 0.0), (_smith_ggx(0.3, 20.0, 55.0),), "Heitz 2014, Eqs. 72 and 99",
    ),
    Case(
        "smith at grazing view", "smith", {"material": "mirror"}, (30.0, 90.0, 180.0), (0.0,), "horizon",
        tags=frozenset({"horizon"}),
    ),
    *_highlights(),
    *_mirrors(),
    *_facets("cook-torrance"),
    *_facets("smith"),
    *_facets("vgroove-sym", max_bounces=1),
    *_facets("vgroove-nonsym", max_bounces=1),
    Case(
        "ilm without roughness", "ilm", {"kd": [0.1, 0.5, 1.0], "ior": 1.5, "sigma": 0.0}, (30.0, 70.0, 180.0),
        tuple(_flat_interfaced(kd, 1.5, 30.0, 70.0) for kd in (0.1, 0.5, 1.0)), "Eq. 9",
        tags=frozenset({"closed", "colour"}),
    ),
    Case(
        "ilm without interface or roughness", "ilm", {"kd": 0.4, "ior": 1.0, "sigma": 0.0}, (80.0, 20.0, 10.0),
        (0.4 / PI,), "kd/pi",
    ),
    Case(
        "ilm with a black body", "ilm", {"kd": 0.0, "ior": 1.5, "ndf": "ggx", "sigma": 0.5}, _NORMAL,
        (0.04 * _AT_NORMAL,), "D(0) F/4", parts={"specular": (0.04 * _AT_NORMAL,), "body": (0.0,)},
        tags=frozenset({"closed", "fresnel", "components"}),
    ),
    Case(
        "ilm seen along the surface", "ilm", {"sigma": 0.5}, (30.0, 90.0, 180.0), (0.0,), "horizon",
        tags=frozenset({"horizon"}),
    ),
    Case(
        "ilm-approx without roughness", "ilm-approx", {"kd": [0.1, 0.5, 1.0], "ior": 1.5, "sigma": 0.0},
        (30.0, 70.0, 180.0), tuple(_flat_interfaced(kd, 1.5, 30.0, 70.0) for kd in (0.1, 0.5, 1.0)), "Eq. 9",
        tags=frozenset({"closed", "colour"}),
    ),
    Case(
        "ilm-approx with a black body", "ilm-approx", {"kd": 0.0, "ior": 1.5, "sigma": 0.5}, _NORMAL,
        (0.04 * _AT_NORMAL,), "D(0) F/4", parts={"specular": (0.04 * _AT_NORMAL,), "body": (0.0,)},
        tags=frozenset({"closed", "fresnel", "components"}),
    ),
    *(
        Case(
            f"{model} of one bounce", model,
            {"material": "mirror", "max_bounces": 1, **_GGX, **({"samples": 1} if model == "smith-walk" else {})},
            _NORMAL, (_AT_NORMAL,), "D(0)/4",
        )
        for model in ("smith-multi", "smith-walk")
    ),
    *(
        Case(f"{model} seen along the surface", model, _GGX, (30.0, 90.0, 180.0), (0.0, 0.0, 0.0), "horizon",
             tags=frozenset({"horizon"}))
        for model in ("kulla-conty", "turquin")
    ),
    *_references(),
    *_interfaced(),
)  # fmt: skip
