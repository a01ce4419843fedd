"""The renderer's pieces against other path samplers, and small pictures."""

import json
import math

import matplotlib.image
import numpy as np
import pytest
from click.testing import CliRunner

import brdftab
from brdftab.cli import main
from brdftab.errors import BrdftabError, ParameterError
from brdftab.models.scratch.balance import balanced
from brdftab.scratch_layers import layers, picture, png
from brdftab.scratch_layers.cones import add_base, add_cones
from brdftab.scratch_layers.environment import LIGHTS, add_radiance

SMALL = {"samples": 4, "detail": 1, "maps_size": 64}


def parsed(**keys):
    entry = {"profile": "quartic:0.6", "material": "Fe", "area": 0.5, "width": 0.05, "length": 0.5} | keys
    base = {"model": "smith", "alpha": 0.4, "material": "Fe"}
    return layers.parse({"psi": 5.0, "base": base, "layer": [entry]})


@pytest.fixture(scope="module")
def tables():
    return picture._tables(parsed(), 0)


def vectors(theta, phi):
    theta, phi = np.broadcast_arrays(theta, phi)
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], -1)


def cones(tables, view, light, power, count):
    psi = math.radians(5.0)
    n = view.shape[0]
    normal, tangent = np.tile([0.0, 0.0, 1.0], (n, 1)), np.tile([1.0, 0.0, 0.0], (n, 1))
    out = np.zeros((n, 3))
    axis, kinds = np.array([[1.0, 0.0]]), np.zeros(1, dtype=np.int64)
    fixed = tables.cumulative, tables.ratio, tables.rho, LIGHTS, count, 3
    add_cones(
        np.ones((n, 1)), axis, kinds, normal, tangent, view, light, np.full(n, power), psi, balanced(psi), *fixed, out
    )
    return out


def test_point_light_sees_the_brdf(tables):
    rng = np.random.default_rng(5)
    n = 400
    theta_o, phi_o = rng.uniform(0.0, 1.2, n), rng.uniform(0.0, 2.0 * math.pi, n)
    view = vectors(theta_o, phi_o)
    # lights near the cone: t_i = -t_o, any angle across
    t = -np.arcsin(view[:, 0]) + rng.uniform(-0.05, 0.05, n)
    p = rng.uniform(-1.0, 1.0, n)
    light = np.stack([np.sin(t), np.cos(t) * np.sin(p), np.cos(t) * np.cos(p)], -1)
    found = cones(tables, view, light, 2.0, 1) - cones(tables, view, light, 0.0, 1)
    theta_i, phi_i = np.arccos(light[:, 2]), np.arctan2(light[:, 1], light[:, 0])
    scratch = brdftab.trace_scratch("quartic:0.6", bins=picture.BINS)
    f = scratch.evaluate(theta_i, theta_o, phi_o - phi_i, phi_i=phi_i, psi=math.radians(5.0), material="Fe")
    expected = 2.0 * f * light[:, 2:]
    lit = expected[:, 0] > 1e-3
    assert lit.sum() > 100
    # Fresnel at t_o here, at (t_i - t_o)/2 there, and 17 slices between: measured 1.1 % at the worst
    assert np.allclose(found[lit], expected[lit], rtol=0.015)


def test_cones_gather_the_room(tables):
    view = vectors(np.radians([0.0, 25.0, 50.0]), np.radians([0.0, 40.0, 75.0]))
    found = cones(tables, view, view, 0.0, 20_000)
    scratch = brdftab.trace_scratch("quartic:0.6", bins=picture.BINS)
    fresnel = layers.resolve("scratch", material="Fe").fresnel
    edges = scratch.phi_edges
    for n, v in enumerate(view):
        t = math.asin(v[0])
        k = min(int((math.atan2(v[1], v[2]) / math.pi + 0.5) * picture.BINS), picture.BINS - 1)
        rho = scratch.shaded(t, fresnel)[k]
        expected = np.zeros(3)
        for j in range(picture.BINS):
            s = np.linspace(math.sin(edges[j]), math.sin(edges[j + 1]), 33)
            for x in 0.5 * (s[1:] + s[:-1]):
                c = math.sqrt(1.0 - x * x)
                weight = rho[j] * (s[1] - s[0])
                add_radiance(-v[0], math.cos(t) * x, math.cos(t) * c, weight, LIGHTS, expected)
        # Eq. 5; measured 5e-5: slices of t, ends of windows
        assert np.allclose(found[n], expected, rtol=2e-4)


@pytest.mark.parametrize(
    ("direction", "rgb"),
    [
        ((0.0, 1.0, 0.0), (0.13, 0.145, 0.175)),
        ((1.0, 0.0, 0.0), (0.18, 0.1825, 0.19)),
        ((0.0, -1.0, 0.0), (0.012, 0.012, 0.014)),
    ],
)
def test_room_without_lights_is_grey(direction, rgb):
    """Straight up, at the horizon with its glow, and the darker floor: what every picture in the docs is lit by."""
    found = np.zeros(3)
    add_radiance(*direction, np.ones(3), np.zeros((0, 6)), found)
    np.testing.assert_allclose(found, rgb, rtol=1e-9)


def test_base_gathers_the_room_as_its_brdf_does():
    # a Lambertian base under the room: its albedo times the mean radiance weighted by the cosine
    layered = layers.parse({"base": {"model": "lambert", "kd": 0.6}, "layer": [
        {"profile": "flat", "material": "mirror", "area": 0, "width": 1, "length": 1}]})  # fmt: skip
    tables = picture._tables(layered, 1)
    up = np.array([[0.0, 0.0, 1.0]])
    out = np.zeros((64, 3))
    normal = np.repeat(up, 64, axis=0)
    view = vectors(np.full(64, 0.5), np.linspace(0.0, 6.0, 64))
    add_base(np.ones(64), normal, view, tables.directions, tables.weights, LIGHTS, picture.SAMPLES, 1, out)
    n = 256
    u, a = np.meshgrid((np.arange(n) + 0.5) / n, (np.arange(n) + 0.5) / n * 2.0 * math.pi)
    d = vectors(np.arcsin(np.sqrt(u.ravel())), a.ravel())
    mean = np.zeros(3)
    for x, y, z in d:
        add_radiance(x, y, z, np.full(3, 1.0 / n**2), LIGHTS, mean)
    # 64 turns of 256 samples: measured 2.1 %
    assert np.allclose(out.mean(axis=0), 0.6 * mean, rtol=0.03)


@pytest.mark.parametrize("tilt", [0.0, 0.5])
def test_base_turns_its_directions_with_the_view(tilt):
    # one row, for a viewer at 45 degrees, of one direction; all of it tilted about a diagonal
    turns = np.linspace(0.0, 6.0, 20)
    a, c, s = math.sqrt(0.5), math.cos(tilt), math.sin(tilt)
    cross = a * np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [-1.0, 1.0, 0.0]])
    turn = np.eye(3) + s * cross + (1.0 - c) * cross @ cross
    # narrow windows all around tell azimuths apart
    windows = np.array([[azimuth, 0.0, 2.0, 90.0, 1.0, 0.0] for azimuth in range(-180, 180, 8)])
    view = vectors(np.full(20, 0.25 * math.pi), turns) @ turn.T
    normal = np.tile([0.0, 0.0, 1.0], (20, 1)) @ turn.T
    drawn, out = vectors(0.6, 2.0)[None, None], np.zeros((20, 3))
    add_base(np.ones(20), normal, view, drawn, np.ones((1, 1, 3)), windows, 1, 1, out)
    expected = np.zeros((20, 3))
    for n, (x, y, z) in enumerate(vectors(0.6, 2.0 + turns) @ turn.T):
        add_radiance(x, y, z, np.ones(3), windows, expected[n])
    assert np.ptp(expected, axis=0).min() > 0.1
    assert np.allclose(out, expected, rtol=1e-9)


@pytest.mark.parametrize("projection", picture.PROJECTIONS)
def test_tangents_follow_the_texture(projection):
    sphere = picture.Sphere(parsed(), projection, 2.0)
    rng = np.random.default_rng(1)
    r, a = np.sqrt(rng.uniform(0.01, 0.8, 100)), rng.uniform(0.0, 2.0 * math.pi, 100)
    x, y = r * np.cos(a), r * np.sin(a)
    normal, tangent, u, v, scale = picture._surface(x, y, sphere)
    assert np.allclose(np.linalg.norm(tangent, axis=-1), 1.0)
    assert np.allclose(np.einsum("ni,ni->n", normal, tangent), 0.0, atol=1e-12)
    for direction, grows in ((tangent, (1.0, 0.0)), (np.cross(normal, tangent), (0.0, 1.0))):
        step = 1e-6
        moved = normal + step * direction
        moved /= np.linalg.norm(moved, axis=-1, keepdims=True)
        _, _, u1, v1, _ = picture._surface(moved[:, 0], moved[:, 1], sphere)
        # conformal: both axes grow alike
        assert np.allclose((u1 - u) / step, grows[0] * scale, atol=1e-4)
        assert np.allclose((v1 - v) / step, grows[1] * scale, atol=1e-4)


def test_picture_of_both_spheres():
    pixels = picture.render(size=64, **SMALL)
    assert pixels.shape == (64, 128, 3)
    assert pixels.dtype == np.uint8
    assert np.array_equal(pixels, picture.render(size=64, **SMALL))
    assert not np.array_equal(pixels, picture.render(size=64, seed=1, **SMALL))
    left, right = pixels[:, :64].mean(axis=-1), pixels[:, 64:].mean(axis=-1)
    for half in (left, right):
        # highlights and dark parts
        assert half.max() > 240.0
        assert half.min() < 60.0
    # the brushed sphere smears reflections across its scratches: its columns differ, its rows hardly do
    inner = left[14:34, 12:52]
    assert inner.mean(axis=1).std() < 0.5 * inner.mean(axis=0).std()


def test_glints_stand_around_the_highlight():
    spheres = picture.default_spheres()[1:]
    pixels = picture.render(spheres, 128, samples=4, detail=1, maps_size=256).max(axis=-1).astype(float)
    y, x = np.mgrid[0:128, 0:128]
    # the highlight, where the normal halves view and light
    light = np.array(picture.LIGHT) / np.linalg.norm(picture.LIGHT)
    half = light + np.array([0.0, 0.0, 1.0])
    half /= np.linalg.norm(half)
    distance = np.hypot(x - 64 * (1.0 + picture.RADIUS * half[0]), y - 64 * (1.0 - picture.RADIUS * half[1]))
    ring = pixels[(distance > 12) & (distance < 25)]
    # bright points and dark ones side by side
    assert (ring > 230.0).mean() > 0.02
    assert (ring < 150.0).mean() > 0.1


def test_png_is_read_by_others(tmp_path):
    pixels = np.random.default_rng(0).integers(0, 256, (5, 7, 3), dtype=np.uint8)
    png.write(pixels, tmp_path / "p.png")
    assert np.array_equal(np.rint(255.0 * matplotlib.image.imread(tmp_path / "p.png")), pixels)
    with pytest.raises(BrdftabError, match="exists"):
        png.write(pixels, tmp_path / "p.png")
    with pytest.raises(BrdftabError, match=r"end it in \.png"):
        png.write(pixels, tmp_path / "p.jpg")


def test_what_cannot_be_drawn():
    for keys in ({"size": 8}, {"samples": 0}, {"detail": 99}, {"seed": -1}, {"exposure": 0.0}, {"maps_size": 100}):
        with pytest.raises(ParameterError, match=next(iter(keys)).removeprefix("maps_")):
            picture.render([picture.Sphere(parsed())], **({"size": 16} | SMALL | keys))
    with pytest.raises(ParameterError, match="projection = cube"):
        picture.Sphere(parsed(), "cube")
    with pytest.raises(ParameterError, match="tiles = 0"):
        picture.Sphere(parsed(), "front", 0.0)
    entry = {"profile": "flat", "material": "Fe", "area": 0.1, "width": 0.1, "length": 0.1}
    base = {"model": "smith", "alpha_x": 0.1, "alpha_y": 0.4, "material": "Fe"}
    with pytest.raises(ParameterError, match="direction of its own"):
        picture.render([picture.Sphere(layers.parse({"base": base, "layer": [entry]}))], 16, **SMALL)


def test_command(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    entry = '[[layer]]\nprofile = "v:60"\nmaterial = "Cu"\nwidth = 0.02\nlength = 0.2\narea = 0.1\n'
    (tmp_path / "l.toml").write_text('[base]\nmodel = "lambert"\nkd = 0.5\n' + entry)
    words = ["scratch", "picture", "l.toml", "--size", "32", "--samples", "2", "--detail", "1", "--maps-size", "64"]
    done = CliRunner().invoke(main, [*words, "--json"])
    assert done.exit_code == 0, done.stderr
    assert json.loads(done.stdout)["columns"] == 32
    assert matplotlib.image.imread("picture.png").shape == (32, 32, 3)
    for extra in ([], ["--out", "p.gif"], ["--overwrite", "--projection", "x"], ["--overwrite", "--size", "1"]):
        done = CliRunner().invoke(main, [*words, *extra])
        assert done.exit_code == 2
        assert len(done.stderr.splitlines()) == 1
