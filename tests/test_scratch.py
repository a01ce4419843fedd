"""A single scratch: paths against other tracers and closed forms, energy, materials, values and samples."""

import math

import numpy as np
import pytest
from scipy.stats import chi2

import brdftab
from brdftab.errors import FileFormatError, ParameterError
from brdftab.materials.fresnel import conductor, dielectric, mirror, reflectance
from brdftab.models._shared.grooves.groove2d import width_symmetric
from brdftab.models.scratch import balance, light
from brdftab.models.scratch.profiles import measured, parse
from brdftab.models.scratch.trace import distance, trace
from brdftab.models.scratch.tracer import GROUPS, block_tops, path

IRON = {"eta": 2.91, "k": 3.09}
# shares of flux by bounce order, and albedo of iron at t = 0 and 60 degrees along the scratch: two independent tracers,
# the V shapes by unfolding; digits as they were given
REFERENCE = {
    "v:45": ((0.585786, 0.414214, 0.0), (0.42576, 0.41404)),
    "v:30": ((0.267949, 0.464102, 0.267949), (0.31134, 0.29855)),
    "quartic:0.05": (None, (0.52761, 0.51860)),
    "quartic:1": ((0.57260, 0.40744, 0.01996), (0.41854, 0.40537)),
}


def ray_of(profile, x, p, cap=64):
    """Return exit angle, bounces and groups of cosines of one ray."""
    shape = profile.knots, profile.height, profile.slope, profile.bend
    ray = np.empty(3 + GROUPS)
    path(shape, block_tops(*shape), x, math.sin(p), math.cos(p), np.empty(cap), ray)
    return ray[1], int(ray[2]), ray[3:]


def polynomial_tracer(depth, x, p):
    """Follow a ray through the quartic by the roots of its polynomial: exit angle and cosines of incidence."""
    dx, dy = -math.sin(p), -math.cos(p)
    y, cosines = 0.0, []
    for _ in range(64):
        line = np.polynomial.Polynomial([x, dx])
        height = -depth * (1.0 - line**2) ** 2
        roots = (height - np.polynomial.Polynomial([y, dy])).roots()
        real = roots[np.abs(roots.imag) < 1e-9].real
        ahead = np.sort(real[(real > 1e-7) & (np.abs(x + real * dx) <= 1.0)])
        if ahead.size == 0:
            break
        t = ahead[0]
        x, y = x + t * dx, y + t * dy
        slope = 4.0 * depth * x * (1.0 - x * x)
        normal = np.array([-slope, 1.0]) / math.hypot(slope, 1.0)
        c = -(dx * normal[0] + dy * normal[1])
        dx, dy = dx + 2.0 * c * normal[0], dy + 2.0 * c * normal[1]
        cosines.append(c)
    return math.atan2(dx, dy), cosines


@pytest.mark.parametrize("depth", [0.05, 1.0, 3.0])
def test_paths_equal_those_of_another_tracer(depth):
    """512 parabolas against roots of the quartic itself; a ray at the edge between two orders may differ."""
    profile = parse(f"quartic:{depth:g}")
    rng = np.random.default_rng(3)
    apart, other = [], 0
    for x, p in zip(rng.uniform(-0.999, 0.999, 300), np.arcsin(rng.uniform(-0.999, 0.999, 300)), strict=True):
        angle, count, groups = ray_of(profile, x, p)
        expected, cosines = polynomial_tracer(depth, x, p)
        if count != len(cosines):
            other += 1
            continue
        apart.append(abs(angle - expected))
        if count <= GROUPS:
            # each bounce multiplies what the slopes are off by
            np.testing.assert_allclose(groups[:count], np.sort(cosines), atol=2e-3)
    assert other <= 3
    # measured 1e-6, 5e-6 and 2e-5 for the median
    assert np.median(apart) < 1e-5 * (1.0 + 3.0 * depth)


@pytest.mark.parametrize("half_angle", [20.0, 30.0, 45.0, 70.0])
def test_v_shapes_equal_unfolded_grooves(half_angle):
    """Share of each bounce order in every column against the closed form of the beam in a symmetric groove."""
    profile = parse(f"v:{half_angle:g}")
    found = trace(profile)
    tilt = math.radians(90.0 - half_angle)
    x, w = np.polynomial.legendre.leggauss(40)
    edges = found.phi_edges
    worst = 0.0
    for j in range(0, 256, 17):
        low, high = np.sin(edges[j]), np.sin(edges[j + 1])
        sines = 0.5 * (low + high) + 0.5 * (high - low) * x
        expected = np.zeros(12)
        for s, weight in zip(sines, w, strict=True):
            theta = math.asin(s)
            # the beams of both walls, over the aperture 2 tan(half angle) of a groove of height 1 as light sees it
            seen = 2.0 * math.tan(math.radians(half_angle)) * math.cos(theta)
            for k in range(1, 13):
                both = width_symmetric(theta, tilt, k)[0] + width_symmetric(-theta, tilt, k)[0]
                expected[k - 1] += 0.5 * weight * both / seen
        assert expected.sum() == pytest.approx(1.0, abs=1e-9)
        share = found.flux[:, :, j].sum(axis=1) / found.aperture[j]
        expected[4] = expected[4:].sum()
        worst = max(worst, float(np.abs(share - expected[:5]).max()))
    # measured 3e-5 (20 degrees), 9e-5 (30, in the bin at the horizon), rounding (45), 2e-5 (70)
    assert worst < 1e-4, worst


@pytest.mark.parametrize("text", REFERENCE)
def test_flux_and_albedo_of_iron(text):
    orders, albedo = REFERENCE[text]
    scratch = brdftab.trace_scratch(text)
    if orders is not None:
        share = scratch.flux.sum(axis=(1, 2)) / 2.0
        np.testing.assert_allclose([share[0], share[1], share[2:].sum()], orders, atol=1e-4)
    found = scratch.albedo(np.radians([0.0, 60.0]), **IRON)[:, 0]
    # V shapes 7e-6, quartics 3e-5, the digits given end at 1e-5
    np.testing.assert_allclose(found, albedo, atol=2e-5 if text.startswith("v") else 6e-5)


@pytest.mark.parametrize("text", ["flat", "v:45", "v:10", "quartic:0.05", "quartic:1", "u:0.5", "ellipse:1", "heights"])
def test_energy_and_reciprocity(text):
    heights = np.random.default_rng(1).normal(0.0, 0.05, 60).cumsum()
    scratch = brdftab.trace_scratch(heights - np.linspace(heights[0], heights[-1], 60) if text == "heights" else text)
    one = scratch.traced
    total = one.layers.sum(axis=0)
    assert np.array_equal(total, total.T)
    # scaled until sums agree to 1e-12
    np.testing.assert_allclose(total.sum(axis=0), one.aperture * (1.0 - one.lost), rtol=1e-8)
    assert (one.layers >= 0.0).all()
    # what 64 bounces cut off: v:10 has 9 bounces at most, rays that run along a wall a few more
    assert one.lost @ one.aperture / 2.0 < 1e-4
    assert scratch.albedo(0.3, material="mirror")[0] == pytest.approx(1.0, abs=1e-4)
    assert (np.abs(one.change - 1.0) < 0.4).all()


def test_a_flat_profile_is_a_mirror():
    for text in ("flat", "v:90", "quartic:0", "ellipse:0", "u:0"):
        flux = brdftab.trace_scratch(text, bins=32).flux
        anti = np.fliplr(np.diag(np.fliplr(flux[0]).diagonal()))
        np.testing.assert_allclose(flux[0], anti, atol=1e-12)
        assert not flux[1:].any()


def test_the_cap_says_what_it_cuts_off():
    whole, short = brdftab.trace_scratch("v:10"), brdftab.trace_scratch("v:10", cap=3)
    left = short.flux.sum(axis=(1, 2)) / 2.0
    np.testing.assert_allclose(left[:3], (whole.flux.sum(axis=(1, 2)) / 2.0)[:3], atol=2e-3)
    assert not left[3:].any()
    lost = short.lost @ short.traced.aperture / 2.0
    assert lost == pytest.approx(1.0 - left.sum(), abs=1e-9)
    assert lost > 0.5


def test_measured_heights_make_the_shape_they_were_taken_from():
    """A quartic sampled at 400 places against the quartic itself: the flux that goes elsewhere."""
    x = -1.0 + 2.0 * (np.arange(400) + 0.5) / 400
    sampled = trace(measured(-0.3 * (1.0 - x * x) ** 2))
    exact = trace(parse("quartic:0.3"))
    # measured 0.012 with 512 rays; both have that much of their own
    assert distance(sampled, exact) < 0.03
    np.testing.assert_allclose(sampled.flux.sum(axis=(1, 2)), exact.flux.sum(axis=(1, 2)), atol=1e-3)


def test_bulges_wrap_at_the_highest_point():
    """A bump in the middle of a groove is the same as the groove between two bumps."""
    x = -1.0 + 2.0 * (np.arange(256) + 0.5) / 256
    bump = measured(0.4 * np.cos(math.pi * x))
    groove = measured(-0.4 * np.cos(math.pi * x))
    np.testing.assert_allclose(bump.depth, groove.depth, rtol=1e-12)
    assert distance(trace(bump, 64), trace(groove, 64)) < 1e-9
    height, _ = bump.at(np.array([-1.0, 0.0, 1.0]))
    np.testing.assert_allclose(height, [0.0, -bump.depth, 0.0], atol=1e-12)


@pytest.mark.parametrize(
    "fresnel", [conductor(2.91, 3.09), dielectric(1.5), conductor([0.2, 0.9, 1.5], [3.6, 2.3, 1.9])]
)
@pytest.mark.parametrize("text", ["quartic:1", "ellipse:1", "v:30"])
def test_groups_of_cosines_stand_for_every_path(text, fresnel):
    """Against the product of exact reflectances along each of 100,000 rays, standard error below 1.5e-4."""
    profile = parse(text)
    shape = profile.knots, profile.height, profile.slope, profile.bend
    tops = block_tops(*shape)
    rng = np.random.default_rng(2)
    n = 100_000
    sines, places = (np.arange(n) + rng.random(n)) / n * 2.0 - 1.0, rng.uniform(-1.0, 1.0, n)
    found = brdftab.trace_scratch(text)
    # orders up to GROUPS: the groups are the cosines themselves
    rays = np.empty((n, 3 + GROUPS))
    cosines = np.empty(64)
    for k in range(n):
        path(shape, tops, places[k], sines[k], math.sqrt(1.0 - sines[k] ** 2), cosines, rays[k])
    count = rays[:, 2].astype(int)
    for t in (0.0, 1.0, 1.4):
        product = np.ones((n, fresnel.a.size))
        for g in range(GROUPS):
            part = reflectance(fresnel, math.cos(t) * rays[:, 3 + g])
            product *= np.where((g < count)[:, None], part, 1.0)
        power = np.maximum(count / GROUPS, 1.0)
        truth = (product ** power[:, None] * (count > 0)[:, None]).mean(axis=0)
        share = 0.5 * found.traced.aperture @ found.traced.reflected(t, fresnel)
        spread = product.std(axis=0) / math.sqrt(n)
        assert (np.abs(share - truth) < 3.5 * spread + 2e-4).all(), (t, share - truth)


@pytest.mark.parametrize("degrees", [0.01, 1.0, 5.0, 20.0])
def test_furnace_of_the_blurred_cone(degrees):
    """Quadrature over the cone, in the paper's coordinates, against 1; and the albedo hook against quadrature.

    With 1/cos t for the factor of either side 1.4e-2 is lost at 20 degrees, and 2.6 times the light comes back along
    the surface.
    """
    scratch = brdftab.trace_scratch("quartic:1", bins=64)
    psi = math.radians(degrees)
    x, w = np.polynomial.legendre.leggauss(24)
    edges = scratch.phi_edges
    p = (0.5 * (edges[:-1] + edges[1:])[:, None] + 0.5 * np.diff(edges)[:, None] * x).ravel()
    weight_p = np.tile(w, 64) * np.repeat(0.5 * np.diff(edges), 24)
    for t_i in np.radians([0.0, 30.0, 60.0, 80.0, 85.0, 89.0, 89.9, 89.999]):
        theta_i = math.acos(math.cos(t_i) * math.cos(0.4))
        phi_i = math.atan2(math.cos(t_i) * math.sin(0.4), math.sin(t_i))
        low, high = max(-t_i - psi, -0.5 * math.pi), min(-t_i + psi, 0.5 * math.pi)
        t = 0.5 * (low + high) + 0.5 * (high - low) * x
        up = np.cos(t)[:, None] * np.cos(p)
        azimuth = np.arctan2(np.cos(t)[:, None] * np.sin(p), np.sin(t)[:, None])
        f = scratch.evaluate(theta_i, np.arccos(up), azimuth - phi_i, phi_i=phi_i, psi=psi, material="mirror")[..., 0]
        total = np.einsum("t,p,tp->", 0.5 * (high - low) * w * np.cos(t), weight_p, f * up)
        assert total == pytest.approx(1.0, abs=2e-6)
        own = brdftab.albedo("scratch", theta_i, phi_i=phi_i, bins=64, psi=psi, material="mirror")
        assert own == pytest.approx(total, abs=2e-6)


def test_balance_of_the_blur_is_the_inverse_cosine_away_from_the_horizon():
    """For narrow cones; for any the constant is that of a cone that nothing cuts, by quadrature."""
    t = np.radians([[0.0, 20.0, -45.0, 70.0]])
    for degrees, apart in ((0.01, 2e-9), (1.0, 1.2e-5), (5.0, 3e-4)):
        psi = math.radians(degrees)
        found = balance.strengths(t, psi, balance.balanced(psi)) * np.cos(t)
        assert np.abs(found - 1.0).max() < apart
        x, w = np.polynomial.legendre.leggauss(20)
        whole = 0.9375 * (w * (1.0 - x * x) ** 2) @ np.cos(psi * x)
        assert found == pytest.approx(whole**-0.5, abs=1e-9)


@pytest.mark.parametrize("width", [1e-6, 0.004, 0.0099, 0.0101, 0.02, 0.05, 0.2, 1.0, 0.5 * math.pi])
def test_norm_of_the_kernel_around_a_light(width):
    """By series: the closed form is wrong by .2 % at a width of .01 and by 4e-7 at .05."""
    x, w = np.polynomial.legendre.leggauss(30)
    angle = 0.5 * width * (x + 1.0)
    plain = 2.0 * math.pi * 0.5 * width * w @ (np.sin(angle) * (1.0 - (angle / width) ** 2) ** 2)
    # measured: 4e-15 at most
    assert light.norm(width) == pytest.approx(plain, rel=1e-14)
    assert light.norm(math.radians(1.0)) == pytest.approx(1.0 / 3135.0, rel=1e-3)


@pytest.mark.parametrize("degrees", [0.0, 30.0, 60.0, 85.0])
def test_furnace_of_a_light_from_everywhere(degrees):
    """Lights of all directions whose kernel meets the cone add up to 1; the printed formula gives .995 to .163."""
    scratch, psi = brdftab.trace_scratch("quartic:1", bins=32), math.radians(1.0)
    t_o, p_o = math.radians(degrees), 0.3
    theta_o = math.acos(math.cos(t_o) * math.cos(p_o))
    phi_o = math.atan2(math.cos(t_o) * math.sin(p_o), math.sin(t_o))
    x, w = np.polynomial.legendre.leggauss(24)
    t = -t_o + psi * x
    edges = scratch.phi_edges
    p = (0.5 * (edges[:-1] + edges[1:])[:, None] + 0.5 * np.diff(edges)[:, None] * x).ravel()
    weight_p = np.tile(w, 32) * np.repeat(0.5 * np.diff(edges), 24)
    up, across = np.cos(t)[:, None] * np.cos(p), np.cos(t)[:, None] * np.sin(p)
    phi_l = np.arctan2(across, np.sin(t)[:, None])
    found = scratch.lit(np.arccos(up), theta_o, phi_o - phi_l, phi_l=phi_l, psi=psi, material="mirror")[..., 0]
    total = np.einsum("t,p,tp->", psi * w * np.cos(t), weight_p, found)
    # 8e-4 is missing, 2.2e-3 at 85 degrees: lights below the horizon whose kernel reaches above it are not added
    assert 1.0 - 3e-3 < total < 1.0


@pytest.mark.parametrize("text", ["quartic:1", "v:30", "u:0.4"])
def test_samples_follow_their_density(text):
    """Chi-square of 100,000 samples in the angles across and along; weights average to the albedo."""
    theta_i, phi_i, n, psi = 0.7, 0.8, 100_000, math.radians(2.0)
    scratch = brdftab.trace_scratch(text, bins=32)
    drawn = scratch.sample(theta_i, n, phi_i=phi_i, psi=psi, seed=5, **IRON)
    assert drawn.valid.all()
    t = np.arcsin(np.sin(drawn.theta_o) * np.cos(drawn.phi_o))
    p = np.arctan2(np.sin(drawn.theta_o) * np.sin(drawn.phi_o), np.cos(drawn.theta_o))
    t_i = math.asin(math.sin(theta_i) * math.cos(phi_i))
    # edges inside bins, so that the density's position in a bin counts, too
    across, along = np.linspace(-0.5 * math.pi, 0.5 * math.pi, 49), -t_i + psi * np.linspace(-1.0, 1.0, 6)
    seen = np.histogram2d(p, t, [across, along])[0]
    x, w = np.polynomial.legendre.leggauss(8)
    split = np.unique(np.round(np.concatenate([across, scratch.phi_edges]), 12))
    nodes = (0.5 * (split[:-1] + split[1:])[:, None] + 0.5 * np.diff(split)[:, None] * x).ravel()
    weight = np.tile(w, split.size - 1) * np.repeat(0.5 * np.diff(split), 8)
    expected = np.zeros(seen.shape)
    for b in range(5):
        ts = 0.5 * (along[b] + along[b + 1]) + 0.5 * (along[b + 1] - along[b]) * x
        up = np.cos(ts)[:, None] * np.cos(nodes)
        azimuth = np.arctan2(np.cos(ts)[:, None] * np.sin(nodes), np.sin(ts)[:, None])
        density = scratch.pdf(theta_i, np.arccos(up), azimuth - phi_i, phi_i=phi_i, psi=psi)
        line = (0.5 * (along[b + 1] - along[b]) * w * np.cos(ts)) @ density * weight
        expected[:, b] = np.add.reduceat(line, np.searchsorted(nodes, across[:-1]))
    assert expected.sum() == pytest.approx(1.0, abs=1e-6)
    expected *= n
    used = expected > 8.0
    statistic = float((((seen - expected) ** 2)[used] / expected[used]).sum())
    assert chi2.sf(statistic, used.sum() - 1) > 1e-3
    mean, spread = drawn.weight.mean(), drawn.weight.std() / math.sqrt(n)
    albedo = brdftab.albedo("scratch", theta_i, phi_i=phi_i, profile=text, bins=32, psi=psi, **IRON)[0]
    # the registry's scratch takes more rays
    assert mean == pytest.approx(albedo, abs=4.0 * spread + 5e-4)


def test_orders_add_up_and_values_are_those_of_the_flux():
    parts = brdftab.evaluate("scratch", 0.5, 0.5, math.pi, phi_i=1.2, components=True, psi=0.1, **IRON)
    assert list(parts) == ["order1", "order2", "order3", "order4", "higher"]
    whole = brdftab.evaluate("scratch", 0.5, 0.5, math.pi, phi_i=1.2, psi=0.1, **IRON)
    np.testing.assert_allclose(sum(parts.values()), whole, rtol=1e-14)
    scratch = brdftab.trace_scratch("quartic:1", rays=4096)
    t, p = math.asin(math.sin(0.5) * math.cos(1.2)), math.atan2(math.sin(0.5) * math.sin(1.2), math.cos(0.5))
    j, k = (int((a / math.pi + 0.5) * 256) for a in (p, -p))
    rho = scratch.shaded(t, conductor(**IRON))[k, j, 0]
    assert whole[0] == pytest.approx(rho * 0.9375 / 0.1 * balance.far(0.1) ** 2 / math.cos(t) ** 2, rel=1e-12)
    np.testing.assert_allclose(scratch.shaded(0.3, mirror())[..., 0], scratch.rho(), rtol=1e-12)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"profile": "vee"}, ("profile = vee", "quartic:DEPTH")),
        ({"profile": "v:0"}, ("profile", "v:0", "degrees")),
        ({"profile": "quartic:-1"}, ("quartic:-1", "[0, 100]")),
        ({"profile": "u:1:1"}, ("u:1:1", "[2, 100]")),
        ({"profile": "file:none.csv"}, ("none.csv", "cannot be opened")),
        ({"profile": [0.0, 1.0]}, ("at least 8",)),
        ({"profile": [0.0] * 8 + [math.nan]}, ("nan", "number 9")),
        ({"profile": [0.0] * 8 + [1e3]}, ("depth 1000", "half widths")),
        ({"profile": "v:45", "bins": 7}, ("bins = 7", "[8, 512]")),
        ({"profile": "v:45", "rays": 0}, ("rays = 0", "[16,")),
        ({"profile": "v:45", "cap": 0}, ("cap = 0", "[1,")),
        ({"profile": "v:45", "tolerance": 0.0}, ("tolerance = 0", "[1e-5, 1]")),
        ({"profile": "v:45", "rays": 64, "tolerance": 0.1}, ("exclude each other",)),
    ],
)
def test_bad_input_is_one_line(given, words):
    with pytest.raises(ParameterError) as caught:
        brdftab.trace_scratch(**given)
    line = str(caught.value)
    assert all(word in line for word in words), line
    assert "\n" not in line


def test_heights_from_files(tmp_path):
    x = np.linspace(0.0, 4.0, 101)
    y = -0.2 * np.sin(math.pi * x / 4.0)
    np.save(tmp_path / "h.npy", y)
    np.savetxt(tmp_path / "h.csv", np.stack([x, y], axis=1), delimiter=",")
    # two columns carry their own scale: half the width is 2
    one = parse(f"file:{tmp_path / 'h.npy'}").depth
    two = parse(f"file:{tmp_path / 'h.csv'}").depth
    assert two == pytest.approx(0.5 * one, rel=2e-2)
    np.savetxt(tmp_path / "unsorted.csv", np.stack([x[::-1], y], axis=1))
    (tmp_path / "words.csv").write_text("a,b\nc,d\n")
    (tmp_path / "empty.csv").write_text("")
    (tmp_path / "cut.npy").write_bytes((tmp_path / "h.npy").read_bytes()[:300])
    for name, match in (
        ("unsorted.csv", "does not increase at row 2"),
        ("words.csv", "not a list of heights"),
        ("empty.csv", "no numbers"),
        ("cut.npy", "damaged or no .npy of numbers"),
    ):
        with pytest.raises(FileFormatError, match=match):
            brdftab.trace_scratch(f"file:{tmp_path / name}")


def test_vertical_walls_are_traced():
    """A box of depth 1 as heights: steep ramps of the spline in place of the walls."""
    box = np.where(np.abs(np.linspace(-1.0, 1.0, 64)) < 0.7, -1.0, 0.0)
    scratch = brdftab.trace_scratch(box)
    assert scratch.albedo(0.0, material="mirror")[0] == pytest.approx(1.0, abs=1e-3)
    assert np.isfinite(scratch.flux).all()


def test_tolerance_is_met_and_errors_are_honest():
    """The stated error against the distance to a much finer trace."""
    fine = trace(parse("quartic:1"), 128, 16384)
    for tolerance in (0.1, 0.03):
        found = brdftab.trace_scratch("quartic:1", bins=128, tolerance=tolerance)
        assert found.error <= tolerance
        # two traces of equal error are sqrt 2 times it apart
        assert distance(found.traced, fine) < 1.2 * tolerance


def test_approximate_reflectances_are_chosen_by_name():
    """Schlick by name is Schlick by f0; Lazanyi is nearer to the exact albedo of iron than Schlick."""
    scratch = brdftab.trace_scratch("quartic:1", bins=64)
    f0 = ((2.91 - 1.0) ** 2 + 3.09**2) / ((2.91 + 1.0) ** 2 + 3.09**2)
    t = np.radians([0.0, 60.0, 80.0])
    exact, schlick, lazanyi = (scratch.albedo(t, fresnel=how, **IRON) for how in ("exact", "schlick", "lazanyi"))
    np.testing.assert_allclose(schlick, scratch.albedo(t, f0=f0), rtol=1e-9)
    assert np.array_equal(exact, scratch.albedo(t, **IRON))
    assert (np.abs(lazanyi - exact) < 0.25 * np.abs(schlick - exact)).all()
    with pytest.raises(ParameterError, match="fresnel = cook"):
        scratch.albedo(0.0, fresnel="cook")


def test_no_light_comes_back_from_a_well_too_deep_to_trace():
    """Columns without flux have no density; they were 0/0."""
    scratch = brdftab.trace_scratch("u:100:100", bins=32, rays=512)
    drawn = scratch.sample(1.4, 200, phi_i=1.57, seed=3, material="mirror")
    assert not drawn.valid.any()
    assert np.all(drawn.pdf == 0.0)
    assert np.all(drawn.weight == 0.0)
    assert scratch.pdf(1.4, 1.4, math.pi, phi_i=1.57) == 0.0
