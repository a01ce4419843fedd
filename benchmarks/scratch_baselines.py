"""What simpler models make of a scratch: error of each against rays with exact Fresnel at every bounce.

    python benchmarks/scratch_baselines.py              # a table a profile
    python benchmarks/scratch_baselines.py --json

The reference multiplies the exact reflectance of every bounce of every ray, at every angle t along the scratch. Errors
are the light that goes elsewhere, over all light that leaves: sum |f - f_ref| cos / sum f_ref cos over the outgoing
angles across, which for Ashikhmin-Shirley forgives its width along the scratch. Lights are at an angle along the
scratch with all angles across lit evenly, and at an angle across.
"""

from __future__ import annotations

import argparse
import json
import math
import time

import numba
import numpy as np

import brdftab
from brdftab.materials import fresnel
from brdftab.materials.fresnel import Fresnel
from brdftab.models._shared.fresnel.fresnel import reflectance
from brdftab.models.scratch.flux import aperture, edges
from brdftab.models.scratch.ndf import single_bounce_rho
from brdftab.models.scratch.profiles import parse
from brdftab.models.scratch.tracer import GROUPS, block_tops, path

IRON = (2.91, 3.09)
PROFILES = ("quartic:1", "quartic:0.05", "v:30")
ALONG = (0.0, 30.0, 60.0, 80.0)
ACROSS = (45.0, 75.0)
# slices of the paper's route
SLICES = (0.0, 60.0, 90.0)
NU = 1e4
# columns a light of Ashikhmin-Shirley skips, and nodes over its width along the scratch
SKIP, NODES = 4, 48
Table = dict[tuple[str, float], np.ndarray]


@numba.njit(parallel=True)
def _rays(shape, tops, rays, cap, shift, kinds, a, b, along, out):
    """Add to out (M, S, M) by incident bin, slice and exit bin: the product of reflectances of every ray."""
    bins = out.shape[0]
    for j in numba.prange(bins):
        cosines, ray = np.empty(cap), np.empty(3 + GROUPS)
        low, high = math.sin(math.pi * (j / bins - 0.5)), math.sin(math.pi * ((j + 1.0) / bins - 0.5))
        for n in range(rays):
            # angle and place are even together: a V splits a bin of angles between two, whatever the place
            sine = low + (high - low) * ((0.7548776662466927 * n + shift) % 1.0)
            cosine = math.sqrt((1.0 - sine) * (1.0 + sine))
            path(shape, tops, -1.0 + 2.0 * ((0.5698402909980532 * n + shift) % 1.0), sine, cosine, cosines, ray)
            if ray[2] == 0.0:
                continue
            k = min(max(int((ray[1] / math.pi + 0.5) * bins), 0), bins - 1)
            for s in range(kinds.size):
                product = 1.0
                for q in range(int(ray[2])):
                    product *= reflectance(kinds[s], a[s], b[s], along[s] * cosines[q])
                out[j, s, k] += product


def simulated(profile: str, bins: int, rays: int, slices: list[tuple[Fresnel, float]], shift: float) -> np.ndarray:
    """Return the flux (S, M, M) by slice, exit and incident bin; a slice is a reflectance and an angle in degrees."""
    cut = parse(profile)
    shape = cut.knots, cut.height, cut.slope, cut.bend
    kinds = np.array([f.kind for f, _ in slices])
    a, b = (np.array([getattr(f, name)[0] for f, _ in slices]) for name in "ab")
    along = np.cos(np.radians([t for _, t in slices]))
    out = np.zeros((bins, len(slices), bins))
    _rays(shape, block_tops(*shape), rays, 256, shift, kinds, a, b, along, out)
    return out.transpose(1, 2, 0) * (aperture(bins) / rays)


def routed(slices: list[np.ndarray], t: float) -> tuple[np.ndarray, float]:
    """Return the paper's Eq. 2 from slices at 0, 60 and 90 degrees, and the share of light in bins without a gamma.

    There the logarithm's argument is not positive, and the slice at 0 is taken.
    """
    normal, middle, mirror = slices
    rise = mirror - normal
    remapped = np.divide(middle - normal, rise, out=np.ones_like(rise), where=rise > 0.0)
    broken = (mirror > 0.0) & (remapped <= 0.0)
    gamma = np.log(np.where(broken, 1.0, np.maximum(remapped, 1e-300))) / math.log(2.0 / 3.0)
    ratio = np.where(broken, 0.0, (t / 90.0) ** gamma if t > 0.0 else np.zeros_like(gamma))
    return ratio * mirror + (1.0 - ratio) * normal, float(broken.sum() / np.count_nonzero(mirror > 0.0))


def phong(bins: int, nv: float, columns: np.ndarray, t: float) -> np.ndarray:
    """Return flux (M, N) of Ashikhmin-Shirley by exit bin, for light at the angle t (degrees) in N columns."""
    middle = 0.5 * (edges(bins)[:-1] + edges(bins)[1:])
    ti, pi = math.radians(t), middle[columns]
    x, w = np.polynomial.legendre.leggauss(NODES)
    reach = 12.0 / math.sqrt(NU)
    low, high = max(-ti - reach, -0.5 * math.pi), min(-ti + reach, 0.5 * math.pi)
    to = 0.5 * (low + high) + 0.5 * (high - low) * x

    def spherical(along: np.ndarray, across: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        up = np.cos(along) * np.cos(across)
        return np.arccos(np.clip(up, -1.0, 1.0)), np.arctan2(np.cos(along) * np.sin(across), np.sin(along))

    theta_i, phi_i = spherical(np.full(pi.size, ti), pi)
    theta_o, phi_o = spherical(*np.meshgrid(to, middle, indexing="ij"))
    given = {"nu": NU, "nv": nv, "eta": IRON[0], "k": IRON[1]}
    f = brdftab.evaluate(
        "ashikhmin-shirley",
        theta_i,
        theta_o[..., None],
        phi_o[..., None] - phi_i,
        phi_i=phi_i,
        **given,  # type: ignore[arg-type]
    )[..., 0]
    weight = 0.5 * (high - low) * w * np.cos(to) ** 2
    share = aperture(bins)
    return np.einsum("tkn,t->kn", f, weight) * share[:, None] * share[columns]


def lights(bins: int) -> list[tuple[str, float, np.ndarray]]:
    """Return name, angle along the scratch (degrees) and columns of every light."""
    found = [(f"along {t:g}", t, np.arange(SKIP // 2, bins, SKIP)) for t in ALONG]
    for p in ACROSS:
        at = int((p / 180.0 + 0.5) * bins)
        found.append((f"across {p:g}", 0.0, np.arange(at - 1, at + 2)))
    return found


def fitted_phong(bins: int, reference: dict[str, np.ndarray], nv: float, fit: bool) -> tuple[dict, float]:
    """Return flux by light, with one factor for all lights that makes the mean error least, and the factor."""
    found = {name: phong(bins, nv, columns, t) for name, t, columns in lights(bins)}
    scales = np.geomspace(0.01, 3.0, 300) if fit else np.ones(1)
    errors = [np.mean([error(s * found[name], reference[name]) for name in found]) for s in scales]
    best = float(scales[int(np.argmin(errors))])
    return {name: best * value for name, value in found.items()}, best


def error(flux: np.ndarray, reference: np.ndarray) -> float:
    """Return the light that goes elsewhere over all light that leaves."""
    return float(np.abs(flux - reference).sum() / reference.sum())


def measure(profile: str, bins: int, rays: int) -> dict:
    """Return errors and albedos of every model for one profile."""
    iron = fresnel.conductor(*IRON)
    terms = {how: fresnel.approximated(iron, how) for how in fresnel.APPROXIMATIONS}
    wanted = [(how, t) for how in terms for t in sorted({*ALONG, *SLICES})]
    slices = [(terms[how], t) for how, t in wanted]
    full: Table = dict(zip(wanted, simulated(profile, bins, rays, slices, 0.0), strict=True))
    again: Table = dict(zip(wanted, simulated(profile, bins, rays, slices, 0.37), strict=True))
    scratch = brdftab.trace_scratch(profile, bins=bins)
    share = aperture(bins)
    area = share[:, None] * share
    middle = 0.5 * (edges(bins)[:-1] + edges(bins)[1:])
    halved = np.abs(np.cos(0.5 * (middle[:, None] - middle)))

    def once(t: float) -> np.ndarray:
        return fresnel.reflectance(iron, math.cos(math.radians(t)) * halved)[..., 0]

    listed = lights(bins)
    reference = {name: full["exact", t][:, columns] for name, t, columns in listed}
    models: dict[str, dict[str, np.ndarray]] = {}

    def add(name: str, flux) -> None:
        models[name] = {light: flux(t)[:, columns] for light, t, columns in listed}

    add("rays again", lambda t: again["exact", t])
    add("scratch", lambda t: scratch.shaded(math.radians(t), iron)[..., 0] * area)
    add("scratch, order 1", lambda t: scratch.flux[0] * once(t))
    for masking in ("smith", "v-cavity"):
        cheap = single_bounce_rho(parse(profile), bins, masking) * area
        add(f"slopes, {masking}", lambda t, cheap=cheap: cheap * once(t))
    scales = {}
    models["ashikhmin-shirley nv 2"], _ = fitted_phong(bins, reference, 2.0, False)
    models["same, scaled"], scales["same, scaled"] = fitted_phong(bins, reference, 2.0, True)
    best = min(
        ((*fitted_phong(bins, reference, nv, True), nv) for nv in np.geomspace(0.05, 500.0, 17)),
        key=lambda found: np.mean([error(found[0][name], reference[name]) for name in reference]),
    )
    models["same, best nv"], scales["same, best nv"] = best[:2]
    add("mirror walls", lambda t: full["exact", 90.0])
    broken = {}
    for how in terms:
        if how != "exact":
            add(f"{how} at every bounce", lambda t, how=how: full[how, t])
        three = [full[how, t] for t in SLICES]
        add(f"gamma, {how}", lambda t, three=three: routed(three, t)[0])
        broken[how] = routed(three, 0.0)[1]
    lit = {name: share[columns].sum() for name, _, columns in listed}
    own = {
        how: {
            name: error(routed([full[how, s] for s in SLICES], t)[0][:, columns], full[how, t][:, columns])
            for name, t, columns in listed
        }
        for how in terms
    }
    return {
        "profile": profile,
        "bins": bins,
        "rays": rays,
        "lights": [name for name, _, _ in listed],
        "albedo": {name: float(reference[name].sum() / lit[name]) for name in reference},
        "models": {
            model: {
                "error": {name: error(flux[name], reference[name]) for name in reference},
                "albedo": {name: float(flux[name].sum() / lit[name]) for name in reference},
            }
            for model, flux in models.items()
        },
        "scale": scales,
        "best_nv": float(best[2]),
        "bins_without_gamma": broken,
        "gamma_against_its_own_fresnel": own,
    }


def show(found: dict) -> None:
    """Print one profile's table."""
    names = found["lights"]
    print(f"\n{found['profile']}, iron {IRON[0]} {IRON[1]}, {found['bins']} bins, {found['rays']} rays a bin")
    print(f"{'error / albedo':24s}" + "".join(f"{name:>16s}" for name in names))
    print(f"{'rays, exact Fresnel':24s}" + "".join(f"{'/ ' + format(found['albedo'][n], '.4f'):>16s}" for n in names))
    for model, numbers in found["models"].items():
        cells = (f"{numbers['error'][n]:.4f} / {numbers['albedo'][n]:.4f}" for n in names)
        print(f"{model:24s}" + "".join(f"{cell:>16s}" for cell in cells))
    print(f"best nv {found['best_nv']:.3g}, factors " + ", ".join(f"{v:.3f}" for v in found["scale"].values()))
    for how, share in found["bins_without_gamma"].items():
        own = found["gamma_against_its_own_fresnel"][how]
        print(
            f"gamma, {how}: {100.0 * share:.1f} % of bins have none; against {how} at every bounce "
            + ", ".join(f"{own[n]:.4f}" for n in names)
        )


def main() -> None:
    """Measure and print a table or JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--profiles", default=",".join(PROFILES))
    parser.add_argument("--bins", type=int, default=256)
    parser.add_argument("--rays", type=int, default=32768, help="rays a bin of the reference")
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    results = []
    for profile in given.profiles.split(","):
        started = time.perf_counter()
        results.append(measure(profile, given.bins, given.rays))
        results[-1]["run_time_s"] = time.perf_counter() - started
        if not given.json:
            show(results[-1])
            print(f"run time {results[-1]['run_time_s']:.1f} s")
    if given.json:
        print(json.dumps(results, indent=2))


if __name__ == "__main__":
    main()
