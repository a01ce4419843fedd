"""Mirror reflections that no value holds: flat interfaces lose nothing in albedos, samples, averages and files."""

import json
import math

import chisquare
import numpy as np
import pytest
from click.testing import CliRunner

import brdftab
from brdftab import models
from brdftab.cli import main
from brdftab.evaluation import delta
from brdftab.models.resolve import resolve
from brdftab.scene.verify import _albedos
from brdftab.tables.grid import Grid
from brdftab.tables.measurement import TableMeasurement

D = math.pi / 180.0
ANGLES = np.array([0.0, 30.0, 60.0, 85.0, 89.0]) * D
FLAT = [
    ("ilm", {}),
    ("ilm", {"bounces": "inf"}),
    ("ilm", {"masking": "smith", "ior": 3.0}),
    ("ilm", {"ndf": "gaussian", "kd": 0.2}),
    ("ilm", {"ndf": "ggx", "ior": [1.2, 1.5, 2.0], "kd": 0.0}),
    ("ilm-approx", {"kd": [0.1, 0.5, 0.9]}),
]


def fresnel(theta, n):
    """Return the textbook's reflectance, from the amplitudes of both polarisations."""
    c, t = np.cos(theta), np.sqrt(1.0 - (np.sin(theta) / n) ** 2)
    return 0.5 * (((c - n * t) / (c + n * t)) ** 2 + ((n * c - t) / (n * c + t)) ** 2)


def declared():
    """Return the models that tell of a delta."""
    return [name for name in models.names() if hasattr(models.kernel(name), "mirror_reflectance")]


@pytest.mark.parametrize("name", declared())
def test_who_tells_of_a_delta_samples_it(name):
    spec = models.spec(name)
    flat, rough = resolve(name, **{spec.roughness: 0.0}), resolve(name)
    assert delta.exists(flat)
    assert not delta.exists(rough)
    theta = np.array([0.3, 1.2])
    for setup, present in ((flat, True), (rough, False)):
        assert (models.sampler(name).mirror_mass(setup, theta) > 0.0).all() == present
    assert not delta.reflectance(flat, np.array([0.5 * math.pi + 0.1, math.pi])).any()


def test_every_model_whose_roughness_reaches_zero_tells_of_a_delta():
    """Facets that nothing tilts are mirrors: who lets the roughness reach 0 has a delta, or no mirrors (oren-nayar)."""
    reaching = {
        spec.name for spec in brdftab.list_models() if spec.ndfs and spec.param(spec.roughness).bounds[0] == 0.0
    }
    assert reaching == set(declared())


@pytest.mark.parametrize(("model", "more"), FLAT)
@pytest.mark.parametrize("sigma", [1e-8, 1e-6])
def test_albedo_is_continuous_at_the_flat_limit(model, more, sigma):
    flat = brdftab.albedo(model, ANGLES, sigma=0.0, **more)
    # measured 1e-8 at 89 degrees
    np.testing.assert_allclose(brdftab.albedo(model, ANGLES, sigma=sigma, **more), flat, rtol=0.0, atol=3e-8)


@pytest.mark.parametrize("sigma", [1e-10, 1e-50, 1e-160, 5e-324])
@pytest.mark.parametrize("model", ["ilm", "ilm-approx"])
def test_what_float64_does_not_resolve_is_flat(model, sigma):
    np.testing.assert_array_equal(brdftab.albedo(model, ANGLES, sigma=sigma), brdftab.albedo(model, ANGLES, sigma=0.0))


def test_a_roughness_along_one_axis_alone_is_resolved():
    """Narrower than float64 resolves stands for 1e-9; measured against 1e-7: 8e-6, the most at 85 degrees."""
    wide = {"sigma_y": 0.3, "kd": 1.0}
    tiny, small = (brdftab.albedo("ilm", ANGLES[:4], sigma_x=x, **wide) for x in (1e-160, 1e-7))
    np.testing.assert_allclose(tiny, small, rtol=0.0, atol=2e-5)


@pytest.mark.parametrize("model", ["ilm", "ilm-approx"])
def test_a_white_body_below_a_flat_interface_returns_all_light(model):
    # measured 3e-15, and 1e-12 at 89.9 degrees
    np.testing.assert_allclose(brdftab.albedo(model, [*ANGLES, 89.9 * D], sigma=0.0, kd=1.0), 1.0, atol=5e-12)
    table = brdftab.tabulate_albedo(model, cosines=8, sigma=0.0, kd=1.0)
    np.testing.assert_allclose(table.directional["reflected"], 1.0, atol=1e-6)
    np.testing.assert_allclose(table.average["reflected"], 1.0, atol=1e-6)


@pytest.mark.parametrize(
    ("grid", "cells"),
    [
        ("12x12x18", "average"),
        # light and view in cells of their own
        (Grid.from_axes(theta_i=ANGLES[:4], theta_o=np.array([5.0, 45.0, 70.0]) * D, phi=[0.0, 1.0, 3.0]), "average"),
        ("6x8x6x8", "average"),
        (Grid.from_axes(theta_i=[0.2, 1.1], phi_i=[0.1, 2.0, 4.5], theta_o=[0.4, 0.9, 1.4], phi_o=[0.3, 1.0, 3.7, 5.0]),
         "average"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("model", ["ilm", "ilm-approx"])
def test_rows_of_averages_keep_the_energy(model, grid, cells):
    """Sums of f cos(theta_o) over the cells of the views are what the light's cell returns: 1 for a white body."""
    if not isinstance(grid, str):
        edges = {f"{k}_edges": v for k, v in grid.edges.items()}
        grid = Grid(**grid.axes, **edges, cell=cells)
    table = brdftab.tabulate(model, grid, cell=cells, sigma=0.0, kd=1.0, dtype="float64", tolerance=1e-5)
    rows = _albedos(table.values, table.grid)
    # the averages of the body by up to eight nodes an axis leave 2.5e-6 beside the horizon
    np.testing.assert_allclose(rows, 1.0, atol=5e-6)
    assert table.provenance["delta"]["in_cells"]
    assert not np.any((table.provenance["energy_left_out"] or {"values": 0.0})["values"])


def _counted(grid, n, count=400_000):
    """Return the averages of cells that mirrored rays give, drawn by projected solid angle, and standard errors."""
    rng = np.random.default_rng(8)
    theta = np.arcsin(np.sqrt(rng.random(count)))
    azimuth = rng.random(count) * 2.0 * math.pi
    view = np.mod(azimuth + math.pi, 2.0 * math.pi)
    edges = grid.edges
    if grid.isotropic:
        sample = np.stack([theta, theta, np.full(count, math.pi - 1e-9)], axis=1)
        widths = [2.0 * math.pi * np.diff(edges["phi"]) * 2.0]
    else:
        first = [edges["phi_i"][0] + np.mod(azimuth - edges["phi_i"][0], 2.0 * math.pi)]
        last = [edges["phi_o"][0] + np.mod(view - edges["phi_o"][0], 2.0 * math.pi)]
        sample = np.stack([theta, *first, theta, *last], axis=1)
        widths = [np.diff(edges["phi_i"])[:, None, None] * np.diff(edges["phi_o"])]
    polar = [0.5 * np.diff(np.sin(edges[k]) ** 2) for k in ("theta_i", "theta_o")]
    if grid.isotropic:
        mass = polar[0][:, None, None] * polar[1][:, None] * widths[0]
    else:
        mass = polar[0][:, None, None, None] * widths[0] * polar[1][:, None]
    bins = [edges[name] for name in grid.axis_names]
    total = np.histogramdd(sample, bins, weights=fresnel(theta, n))[0]
    square = np.histogramdd(sample, bins, weights=fresnel(theta, n) ** 2)[0]
    # pi is the projected solid angle of all light
    scale = math.pi / count / mass
    return total * scale, np.sqrt(square) * scale


@pytest.mark.parametrize(
    "grid",
    [
        Grid.parse("6x9x5", "average"),
        Grid.from_axes(theta_i=[0.2, 1.1], theta_o=[0.4, 0.9, 1.4], phi=[0.5, 2.0, 3.0], cell="average"),
        Grid.parse("3x5x4x7", "average"),
        Grid.from_axes(
            theta_i=[0.2, 1.1], phi_i=[0.1, 2.0, 4.5], theta_o=[0.4, 0.9], phi_o=[0.3, 1.0, 3.7, 5.0], cell="average"
        ),
    ],
    ids=["even", "uneven", "even azimuths", "uneven azimuths"],
)
def test_averages_of_the_delta_are_those_of_counted_rays(grid):
    expected, error = _counted(grid, 1.6)
    cells = np.argwhere(np.ones(grid.shape, dtype=bool))
    found = delta.cell_averages(resolve("ilm", sigma=0.0, ior=1.6), grid, cells)[:, 0].reshape(grid.shape)
    assert not found[expected == 0.0].any() or np.allclose(found[expected == 0.0], 0.0, atol=1e-4)
    # the worst of all cells lies at 2.5 standard errors
    hit = expected > 0.0
    assert hit.sum() >= 3
    assert (np.abs(found - expected)[hit] < 5.0 * error[hit]).all()
    listed = np.zeros(grid.shape, dtype=bool)
    listed[tuple(grid.mirror_cells().T)] = True
    np.testing.assert_array_equal(found > 0.0, listed)


def test_an_index_near_one_is_averaged_too():
    """F rises within 1 degree of the horizon at an index of 1.0001: against a sum of many more angles."""
    setup, grid = resolve("ilm", sigma=0.0, ior=1.0001), Grid.parse("90x90x180", "average")
    cells = grid.mirror_cells()[-3:]
    found = delta.cell_averages(setup, grid, cells)[:, 0]
    for value, (i, o, _) in zip(found, cells, strict=True):
        assert i == o
        ends = grid.edges["theta_i"][[i, i + 1]]
        theta = ends[0] + (ends[1] - ends[0]) * (np.arange(400_000) + 0.5) / 400_000
        energy = (fresnel(theta, 1.0001) * np.cos(theta) * np.sin(theta)).mean() * (ends[1] - ends[0])
        mass = 0.5 * np.diff(np.sin(ends) ** 2)[0]
        # the sum's own error, and the cancellation in the textbook's formula
        assert value == pytest.approx(energy / (mass * mass * 2.0 * math.radians(1.0)), rel=1e-6)


def test_mirror_cells_of_centers_hold_the_average_and_points_the_finite_part():
    given = {"sigma": 0.0, "kd": [0.2, 0.5, 0.8], "dtype": "float64"}
    centers = brdftab.tabulate("ilm", "8x8x12", **given)
    averages = brdftab.tabulate("ilm", "8x8x12", cell="average", **given)
    mirror = tuple(centers.grid.mirror_cells().T)
    np.testing.assert_allclose(centers.values[mirror], averages.values[mirror], rtol=1e-6)
    other = np.ones(centers.grid.shape, dtype=bool)
    other[mirror] = False
    ti, to, phi = np.meshgrid(*centers.grid.axes.values(), indexing="ij")
    np.testing.assert_allclose(
        centers.values[other], brdftab.evaluate("ilm", ti[other], to[other], phi[other], sigma=0.0, kd=given["kd"])
    )
    assert centers.provenance["averaged_cells"] == 8
    assert centers.provenance["error"]["met"]
    points = brdftab.tabulate("ilm", "5x5x7", cell="point", **given)
    ti, to, phi = np.meshgrid(*points.grid.axes.values(), indexing="ij")
    np.testing.assert_allclose(points.values, brdftab.evaluate("ilm", ti, to, phi, sigma=0.0, kd=given["kd"]))
    told = points.provenance["delta"]
    assert not told["in_cells"]
    np.testing.assert_allclose(
        np.array(told["reflectance"])[:, 1], fresnel(np.radians(told["theta_i_degrees"]), 1.5), rtol=1e-12
    )
    # a table of points leaves the mirror reflection out, and says so
    np.testing.assert_allclose(points.provenance["energy_left_out"]["values"], told["reflectance"])


def test_the_delta_belongs_to_the_specular_component():
    table = brdftab.tabulate("ilm", "6x6x9", sigma=0.0, bounces="inf", components=True, dtype="float64")
    mirror = tuple(table.grid.mirror_cells().T)
    found = delta.cell_averages(resolve("ilm", sigma=0.0), table.grid, table.grid.mirror_cells())
    np.testing.assert_allclose(table.components["specular"][mirror], found, rtol=1e-12)
    assert not table.components["interreflection"].any()


@pytest.mark.parametrize(("model", "more"), FLAT)
@pytest.mark.parametrize("theta_i", [0.2, 1.3])
def test_samples_of_flat_interfaces(model, more, theta_i):
    count = 40_000
    drawn = brdftab.sample(model, theta_i, count, phi_i=0.4, seed=3, sigma=0.0, **more)
    exact = brdftab.albedo(model, theta_i, sigma=0.0, **more)
    error = drawn.weight.std(axis=0) / math.sqrt(count)
    assert (np.abs(drawn.weight.mean(axis=0) - exact) <= 4.0 * error + 1e-12).all()
    assert drawn.delta.mean() == pytest.approx(drawn.mass, abs=4.0 * math.sqrt(0.25 / count))
    assert drawn.valid.all()
    np.testing.assert_allclose(drawn.theta_o[drawn.delta], theta_i)
    np.testing.assert_allclose(drawn.phi_o[drawn.delta], 0.4 + math.pi)
    assert not drawn.pdf[drawn.delta].any()
    # both lobes bring their own share of the light
    share = fresnel(theta_i, np.asarray(resolve(model, **more).fresnel.a))
    mirrored = np.where(drawn.delta[:, None], drawn.weight, 0.0).mean(axis=0)
    np.testing.assert_allclose(mirrored, np.broadcast_to(share, mirrored.shape), rtol=0.1)


def test_the_density_beside_the_delta_is_what_is_drawn():
    given = {"sigma": 0.0, "kd": 0.6, "ior": 1.8}

    def density(theta_o, phi_o):
        return brdftab.pdf("ilm", 1.1, theta_o, phi_o - 0.3, phi_i=0.3, **given)

    sets = []
    for seed, n in ((1, 20_000), (2, 200_000)):
        drawn = brdftab.sample("ilm", 1.1, n, phi_i=0.3, seed=seed, **given)
        kept = ~drawn.delta
        sets.append((drawn.theta_o[kept], drawn.phi_o[kept]))
    result = chisquare.check(sets[0], sets[1], 200_000 - len(sets[1][0]), density)
    assert result.p_value > 1e-3, result
    # 1 minus the mass of the mirror direction: the chi-square's own integral is good to 1e-4
    assert result.integral == pytest.approx(1.0 - drawn.mass, abs=1e-4)
    assert 0.1 < drawn.mass < 0.9


def test_samples_of_rough_surfaces_are_no_deltas():
    for name in ("ilm", "lambert", "smith-walk", "scratch"):
        drawn = brdftab.sample(name, 0.4, 50)
        assert drawn.mass == 0.0
        assert drawn.delta.shape == (50,)
        assert not drawn.delta.any()


def test_eval_tells_of_the_delta(tmp_path):
    words = ["eval", "--model", "ilm", "--sigma", "0", "--theta-i", "60", "--theta-o", "60", "--phi"]
    text = CliRunner().invoke(main, [*words, "180"]).stdout
    assert "0.08918671" in text
    assert "is a delta, no part of the value" in text
    found = json.loads(CliRunner().invoke(main, [*words, "180", "--json"]).stdout)
    assert found["delta"] == pytest.approx([fresnel(math.pi / 3.0, 1.5)])
    assert json.loads(CliRunner().invoke(main, [*words, "179.9", "--json"]).stdout)["delta"] is None
    rough = CliRunner().invoke(main, ["eval", "--model", "ilm", *words[5:], "180", "--json"])
    assert json.loads(rough.stdout)["delta"] is None
    table = CliRunner().invoke(
        main, ["tabulate", "--model", "ilm", "--sigma", "0", "--grid", "4x4x6", "--out", str(tmp_path / "a.npz")]
    )
    assert "mirrored 60  0.08919" in table.stdout
    assert "cells that hold this direction contain it" in table.stdout


@pytest.mark.parametrize("grid", ["12x12x36", "6x8x6x8"])
def test_planned_tables_of_flat_interfaces_keep_their_promise(grid):
    from brdftab.scene import carry_out, expand, parse, plan_material, verify

    keys = {"name": "varnish", "model": "ilm", "parameters": {"sigma": 0.0, "kd": 0.3}, "grid": grid}
    one = parse({"material": [keys]}).materials[0]
    table = carry_out(plan_material(one))
    assert verify(one, table)["holds"]
    mirror = tuple(Grid.parse(grid).mirror_cells().T)
    whole = brdftab.tabulate("ilm", grid, sigma=0.0, kd=0.3)
    np.testing.assert_allclose(expand(table).values[mirror], whole.values[mirror], rtol=1e-4)
    assert table.provenance["delta"]["in_cells"]


def test_fits_leave_cells_with_a_delta_out():
    table = brdftab.tabulate("ilm", "12x12x18", sigma=0.0, kd=0.6, ior=1.4, dtype="float64")
    data = TableMeasurement(table)
    cells = data.cells()
    assert (~cells.valid).sum() == 12
    assert cells.values[~cells.valid].min() > 2.0 * cells.values[cells.valid].max()
    found = brdftab.fit_model(table, "ilm", fixed={"sigma": 0.0, "ior": 1.4})
    assert found.metrics["log_rms"] < 1e-9


def test_scratches_of_no_depth_send_the_delta_into_their_cone():
    """A flat scratch is a mirror blurred to psi: nothing is lost beside its values."""
    light = brdftab.albedo("scratch", ANGLES[:4], profile="flat", material="mirror", rays=64)
    np.testing.assert_allclose(light, 1.0, atol=2e-6)
