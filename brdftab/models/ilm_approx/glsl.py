"""The approximate model as a GLSL function, with the coefficients of the kernel written out."""

from __future__ import annotations

from brdftab.models.ilm_approx.coefficients import COSINE, LAMBERT
from brdftab.models.microfacet.interface import series

Rows = tuple[tuple[int, int, int, int, float], ...]
# terms of the series of r_e that float32 sees for an index up to 3
TERMS = 28
HEAD = """// Interfaced Lambertian microfacets (Beckmann, V-cavities) with an approximate body; written by brdftab.
// f = specular + body in 1/sr, without cosine. Meneveaux et al. 2018, with fitted polynomials for the body.
// sigma in (0, 2]: slope scale, sqrt(2) times the standard deviation of the slope; n in [1, 3]: refractive index.
// Names starting with ilm_ are this file's.

const float ILM_PI = 3.14159265358979;
"""
TRANSMISSION = """
// 1 - F of an interface at the cosine of incidence c
float ilm_transmission(float n, float c) {
    float q = max((n - 1.0) * (n + 1.0), 1.0e-12);
    float g = sqrt(q + c * c);
    float u = g + c;
    float v = (q + 1.0) * c + g;
    return 2.0 * g * c * (1.0 / (u * u) + (q + 1.0) / (v * v));
}
"""
SPECULAR = """
// F D G/(4 cos cos) of Beckmann facets in V-cavities
float ilm_specular(float sigma, float n, float ci, float co, float ch, float ih) {
    float t = (1.0 - ch * ch) / (ch * ch * sigma * sigma);
    float d = exp(-t) / (ILM_PI * sigma * sigma * ch * ch * ch * ch);
    float m = min(1.0, 2.0 * ch * min(ci, co) / ih);
    return (1.0 - ilm_transmission(n, ih)) * d * m / (4.0 * ci * co);
}
"""
WHOLE = """
// kd: albedo of the body; z: surface normal; i, o: unit vectors towards light and view
vec3 ilm_approx(vec3 kd, float n, float sigma, vec3 z, vec3 i, vec3 o) {
    float ci = dot(z, i);
    float co = dot(z, o);
    if (min(ci, co) <= 0.0) { return vec3(0.0); }
    float si = sqrt(max(0.0, 1.0 - ci * ci));
    float so = sqrt(max(0.0, 1.0 - co * co));
    float both = max(si * so, 1.0e-12);
    float c = clamp((dot(i, o) - ci * co) / both, -1.0, 1.0);
    vec3 h = normalize(i + o);
    vec3 kappa = kd / (n * n * (1.0 - kd) + kd * (1.0 - ilm_external(n)));
    return ilm_specular(sigma, n, ci, co, dot(z, h), dot(i, h)) + kappa * ilm_body(sigma, n, si, ci, so, co, c);
}
"""


def _number(value: float) -> str:
    """Return a float literal with the digits of float32."""
    text = f"{value:.9g}"
    return text if "." in text or "e" in text else f"{text}.0"


def _power(name: str, exponent: int) -> list[str]:
    return [name] * exponent


def _term(row: tuple[int, int, int, int, float], one: str, other: str) -> str:
    """Return one term without its coefficient as a product."""
    p, q, m, k, _ = row
    factors = [*_power(one, p), *_power(other, q), *_power("c", m), *_power("y", k)]
    return " * ".join(factors)


def _polynomial(name: str, rows: Rows, one: str, other: str, symmetric: bool) -> list[str]:
    """Return the statements that add up a polynomial."""
    lines = [f"    float {name} = 0.0;"]
    for row in rows:
        terms = [_term(row, one, other)]
        if symmetric and row[0] != row[1]:
            terms.append(_term(row, other, one))
        lines.append(f"    {name} = {name} + ({_number(row[4])}) * ({' + '.join(terms)});")
    return lines


def _external() -> list[str]:
    """Return r_e of an interface, by its series for every index that the model takes."""
    lines = [
        "",
        "// share of diffuse light that an interface reflects outside",
        "float ilm_external(float n) {",
        "    float q = (n - 1.0) * (n + 1.0);",
        "    float p = n * n + 1.0;",
        "    float y = (n - 1.0) / (n + 1.0);",
        "    float a = 0.0;",
    ]
    lines += [f"    a = a * y + ({_number(float(v))});" for v in series(TERMS)[::-1]]
    return [*lines, "    return a + n * n * q * q / (p * p * p) * log(max(y, 1.0e-30));", "}"]


def _body() -> list[str]:
    """Return the body integral, statement by statement as in approximation.py."""
    lines = [
        "",
        "// body integral: L T(ci') T(co')/pi; s, c: sine and cosine of the polar angles, c: cosine of phi_o - phi_i",
        "float ilm_body(float sigma, float n, float si, float ci, float so, float co, float c) {",
        "    float wi = ci + sigma * si;",
        "    float wo = co + sigma * so;",
        "    float x = sigma * si / wi;",
        "    float z = sigma * so / wo;",
        "    float y = sigma * sigma / (1.0 + sigma * sigma);",
    ]
    lines += _polynomial("l", LAMBERT, "x", "z", True)
    lines += _polynomial("a", COSINE, "x", "z", False) + _polynomial("b", COSINE, "z", "x", False)
    return [
        *lines,
        "    float t = ilm_transmission(n, min(1.0, wi * exp(a)));",
        "    float u = ilm_transmission(n, min(1.0, wo * exp(b)));",
        "    return exp(l) * t * u / ILM_PI;",
        "}",
    ]


def source() -> str:
    """Return the text of a GLSL (3.30 and ES 3.00) snippet that defines ``ilm_approx``.

    It evaluates the model in float32: `ilm_body` is the body integral, `ilm_approx` the whole BRDF in 1/sr.
    """
    middle = "\n".join([*_external(), *_body()])
    return f"{HEAD}{TRANSMISSION}{middle}\n{SPECULAR}{WHOLE}"
