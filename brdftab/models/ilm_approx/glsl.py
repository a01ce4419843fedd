"""The closed form as a GLSL function, with the coefficients of coefficients.py written in."""

from __future__ import annotations

from brdftab.models.ilm_approx.coefficients import FACET, LAMBERTIAN, REFLECTANCE

_HEADER = """\
// Interfaced Lambertian microfacets (Meneveaux et al. 2018), Beckmann facets in V-cavities, single bounces.
// Written by "brdftab models ilm-approx --glsl"; the body integral is a fitted closed form of brdftab's own.
//
// ilm_approx   body, 1/sr: kd in [0, 1], n in [1, 2.5], sigma in [0, 1.5] (Beckmann's alpha),
//              cosines of both polar angles in (0, 1], cosine of the azimuth between them (-1: mirror side)
// ilm_specular the other part, 1/sr, for sigma > 0; a flat surface needs a mirror instead
// Neither includes the cosine of the rendering equation.
"""

_TEMPLATE = """
float ilm_root(float h, float square) {
    float r = sqrt(square + h * h);
    return h > 0.0 ? r + h : square / (r - h);
}

float ilm_transmission(float n, float c) {
    float q = (n - 1.0) * (n + 1.0);
    float g = sqrt(max(q + c * c, 1e-12));
    float u = g + c;
    float v = (q + 1.0) * c + g;
    return 2.0 * g * c * (1.0 / (u * u) + (q + 1.0) / (v * v));
}

float ilm_external_reflectance(float n) {
    float y = (n - 1.0) / (n + 1.0);
    float q = (n - 1.0) * (n + 1.0);
    float p = n * n + 1.0;
    float a = @series@;
    return y * a + n * n * q * q / (p * p * p) * log(max(y, 1e-6));
}

float ilm_lambertian(float sigma, float si, float ci, float so, float co, float c) {
    float s2 = sigma * sigma;
    float k = sigma * (@L1@ + @L2@ * sigma);
    float a = si * co;
    float b = so * ci;
    float q = si * so / max(sqrt(ci * ci * co * co + k * k * (a * a + b * b)), 1e-12);
    float x = @L3@ * sigma * q;
    float t = x / (1.0 + x);
    float w = c + sigma * (@L4@ + @L5@ * c * c) / (1.0 + sigma) + t * (@L6@ + c * (@L7@ + @L8@ * c));
    float gain = s2 * (@L9@ + @L10@ * sigma) / (1.0 + @L11@ * sigma);
    float bend = 1.0 + s2 * si * so * (@L12@ + @L13@ * c) / (1.0 + @L14@ * s2);
    return ilm_root(gain * q * w, 1.0) * bend / sqrt(1.0 + @L0@ * s2);
}

float ilm_facet_cosine(float sigma, float n, float si, float ci, float so, float co, float c) {
    float s2 = sigma * sigma;
    float k = sigma * (@F3@ + @F4@ * sigma);
    float a = si * co;
    float b = so * ci;
    float over = max(sqrt(ci * ci * co * co + k * k * (a * a + b * b)), 1e-12);
    float lean = s2 * (@F0@ + @F1@ * sigma) / (1.0 + @F2@ * s2) * (1.0 + @F5@ * (1.0 - 1.0 / (n * n)));
    float tilt = 1.0 / sqrt(1.0 + @F6@ * s2 / (1.0 + @F7@ * s2));
    float t = sigma * si * so / over;
    float lift = sigma * @F8@ * t / (1.0 + t) * (1.0 + @F9@ * c);
    return min(tilt * ilm_root(lean * si * (a + @F10@ * b * c) / over, ci * ci) + lift * (1.0 - ci), 1.0);
}

vec3 ilm_approx(vec3 kd, float n, float sigma, float cos_i, float cos_o, float cos_phi) {
    float si = sqrt(max((1.0 - cos_i) * (1.0 + cos_i), 0.0));
    float so = sqrt(max((1.0 - cos_o) * (1.0 + cos_o), 0.0));
    float ti = ilm_transmission(n, ilm_facet_cosine(sigma, n, si, cos_i, so, cos_o, cos_phi));
    float to = ilm_transmission(n, ilm_facet_cosine(sigma, n, so, cos_o, si, cos_i, cos_phi));
    float matte = ilm_lambertian(sigma, si, cos_i, so, cos_o, cos_phi) * ti * to / 3.14159265358979;
    return kd / (n * n * (1.0 - kd) + kd * (1.0 - ilm_external_reflectance(n))) * matte;
}

float ilm_specular(float n, float sigma, float cos_i, float cos_o, float cos_phi) {
    float si = sqrt(max((1.0 - cos_i) * (1.0 + cos_i), 0.0));
    float so = sqrt(max((1.0 - cos_o) * (1.0 + cos_o), 0.0));
    float up = cos_i + cos_o;
    float flat2 = max(si * si + so * so + 2.0 * si * so * cos_phi, 0.0);
    float full = sqrt(flat2 + up * up);
    float ch = up / full;
    float d = exp(-flat2 / (up * up * sigma * sigma)) / (3.14159265358979 * sigma * sigma * ch * ch * ch * ch);
    float g = min(1.0, 4.0 * ch * min(cos_i, cos_o) / full);
    return d * g * (1.0 - ilm_transmission(n, min(0.5 * full, 1.0))) / (4.0 * cos_i * cos_o);
}
"""


def _number(value: float) -> str:
    """Return a GLSL literal of a coefficient, in parentheses if negative."""
    text = repr(float(value))
    return f"({text})" if value < 0.0 else text


def source() -> str:
    """Return the GLSL text: ``ilm_approx`` and ``ilm_specular`` with all that they call, for any GLSL version."""
    series = _number(REFLECTANCE[-1])
    for c in REFLECTANCE[-2::-1]:
        series = f"{_number(c)} + y * ({series})"
    text = _TEMPLATE.replace("@series@", series)
    for letter, values in (("L", LAMBERTIAN), ("F", FACET)):
        for k, value in enumerate(values):
            text = text.replace(f"@{letter}{k}@", _number(value))
    return _HEADER + text
