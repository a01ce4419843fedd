"""Grids: positions, edges, mirror cells, refusals."""

import json
import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from brdftab.errors import GridError
from brdftab.tables.grid import Grid


def test_center_preset():
    grid = Grid.parse("90x90x180")
    assert grid.shape == (90, 90, 180)
    assert grid.size == 1_458_000
    assert grid.isotropic
    assert grid.square
    assert grid.nbytes(3) == 17_496_000
    assert np.array_equal(grid.theta_i, np.deg2rad(np.arange(90) + 0.5))
    assert np.array_equal(grid.phi_edges, np.deg2rad(np.arange(181.0)))
    assert (grid.theta_i_edges[-1], grid.phi_edges[-1]) == (math.pi / 2, math.pi)


def test_point_preset_includes_both_ends():
    grid = Grid.parse("4x3x5", cell="point")
    assert np.array_equal(grid.theta_i, np.deg2rad([0.0, 30.0, 60.0, 90.0]))
    assert np.array_equal(grid.phi, np.deg2rad([0.0, 45.0, 90.0, 135.0, 180.0]))
    assert not grid.square


def test_anisotropic_presets():
    grid = Grid.parse("2x4x2x4")
    assert grid.axis_names == ("theta_i", "phi_i", "theta_o", "phi_o")
    assert grid.phi is None
    assert not grid.isotropic
    assert np.array_equal(np.degrees(grid.phi_i), [45.0, 135.0, 225.0, 315.0])
    point = Grid.parse("2x4x2x4", cell="point")
    assert np.array_equal(np.degrees(point.phi_o), [0.0, 90.0, 180.0, 270.0])
    # the azimuth is periodic: the cell of 0 reaches from -45 to 45 degrees
    assert np.allclose(np.degrees(point.phi_o_edges), [-45.0, 45.0, 135.0, 225.0, 315.0], rtol=0, atol=1e-12)


def test_axes_from_text_and_arrays():
    grid = Grid.from_axes(theta_i="0:90:91", theta_o="0, 30,60", phi=[0.0, 1.0, math.pi])
    assert grid.shape == (91, 3, 3)
    assert np.array_equal(grid.theta_i, np.deg2rad(np.arange(91.0)))
    assert np.allclose(np.degrees(grid.theta_o_edges), [0, 15, 45, 90], rtol=0, atol=1e-12)
    assert np.array_equal(grid.phi_edges, [0.0, 0.5, 0.5 * (1 + math.pi), math.pi])
    assert Grid.from_axes(theta_i="10", phi="180").shape == (1, 1, 1)
    assert np.array_equal(Grid.from_axes(theta_i="10,20", phi="180").theta_o, np.deg2rad([10.0, 20.0]))


def test_resolve():
    grid = Grid.parse("3x3x6", cell="average")
    assert Grid.resolve(grid) is grid
    assert Grid.resolve("3x3x6", "average") == grid
    assert Grid.resolve({"theta_i": "0,10", "phi": "0,180"}, "point").cell == "point"
    assert Grid.resolve({"theta_i": "0,10", "phi": "0,180", "cell": "average"}).cell == "average"
    for obj, cell in ((grid, "point"), ({"theta_i": "1", "phi": "1", "cell": "point"}, "center")):
        with pytest.raises(GridError, match="contradicts"):
            Grid.resolve(obj, cell)


@pytest.mark.parametrize(
    ("text", "cell", "count"),
    [
        ("90x90x180", "center", 90),
        ("7x7x1", "average", 7),
        ("3x6x3x6", "center", 18),
        # an odd count turns the opposite cell half over two cells
        ("3x5x3x5", "center", 30),
        # equal non-zero angles at phi = 180, and theta = 0 at every phi
        ("4x4x5", "point", 3 + 5),
        ("4x4x4x4", "point", 3 * 4 + 16),
    ],
)
def test_mirror_cells_of_presets(text, cell, count):
    grid = Grid.parse(text, cell=cell)
    cells = grid.mirror_cells()
    assert cells.shape == (count, len(grid.shape))
    assert len({tuple(row) for row in cells}) == count
    assert [tuple(row) for row in cells] == sorted(tuple(row) for row in cells)


def test_mirror_cells_lie_opposite():
    for n in range(2, 60, 2):
        cells = Grid.parse(f"2x{n}x2x{n}").mirror_cells()
        assert len(cells) == 2 * n
        assert (cells[:, 0] == cells[:, 2]).all()
        assert ((cells[:, 3] - cells[:, 1]) % n == n // 2).all()


def test_mirror_cells_of_unequal_axes():
    grid = Grid.from_axes(theta_i="10,20", theta_o="5,15,25,70", phi="0,90,180")
    # edges of theta_i 0 15 90, of theta_o 0 10 20 47.5 90
    pairs = [(0, 0), (0, 1), (1, 1), (1, 2), (1, 3)]
    assert [tuple(row) for row in grid.mirror_cells()] == [(i, o, 2) for i, o in pairs]
    point = Grid.from_axes(theta_i="10,20", theta_o="10,15,20", phi="0,90", cell="point")
    assert point.mirror_cells().shape == (0, 3)
    point = Grid.from_axes(theta_i="10,20", theta_o="10,15,20", phi="0,180", cell="point")
    assert point.mirror_cells().tolist() == [[0, 0, 1], [1, 2, 1]]


@settings(max_examples=60, deadline=None)
@given(st.lists(st.floats(0.0, math.pi / 2), min_size=1, max_size=9, unique=True), st.sampled_from(["center", "point"]))
def test_json_keeps_every_bit(thetas, cell):
    thetas = np.sort(thetas)
    # positions a few units in the last place apart have no edge between them
    assume((np.diff(thetas) > 1e-9).all())
    grid = Grid.from_axes(theta_i=thetas, phi_i="0,90", phi_o="0:350:8", cell=cell)
    back = Grid.from_json(json.loads(json.dumps(grid.to_json())))
    assert back == grid
    assert hash(back) == hash(grid)
    assert all(a.tobytes() == b.tobytes() for a, b in zip(back.edges.values(), grid.edges.values(), strict=True))


def test_grids_are_frozen():
    grid = Grid.parse("2x2x2")
    with pytest.raises(ValueError, match="read-only"):
        grid.theta_i[0] = 1.0
    assert grid != Grid.parse("2x2x2", cell="average")
    assert grid != "2x2x2"


@pytest.mark.parametrize(
    "text",
    [
        "",
        "9",
        "9x9",
        "9x9x9x9x9",
        "axbxc",
        "1e3x1x1",
        "0x2x2",
        "-1x2x3",
        "99999x99999x99999",
        "2.5x2x2",
        "9" * 30 + "x1x1",
    ],
)
def test_malformed_counts_are_refused(text):
    with pytest.raises(GridError, match="grid") as caught:
        Grid.parse(text)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("axes", "match"),
    [
        ({"theta_i": "0:90"}, "malformed"),
        ({"theta_i": "0:90:x"}, "malformed"),
        ({"theta_i": "a,b"}, "malformed"),
        ({"theta_i": "nan"}, "not finite"),
        ({"theta_i": "0:inf:3"}, "not finite"),
        ({"theta_i": "90:0:4"}, "does not increase"),
        ({"theta_i": "0:90:0"}, "at least 1"),
        ({"theta_i": "0:90:99999999"}, "at most"),
        ({"theta_i": "0,181"}, "theta_i = 181 degrees is outside"),
        ({"theta_i": "-1,5"}, "theta_i = -1 degrees is outside"),
        ({"theta_i": [0.0, math.nan]}, "NaN"),
        ({"theta_i": [0.3, 0.2]}, "does not increase"),
        ({"theta_i": [0.2, 0.2]}, "does not increase"),
        ({"theta_i": []}, "shape|type"),
        ({"theta_i": [[0.1, 0.2]]}, "shape"),
        ({"theta_i": [None]}, "type"),
        ({"theta_i": [[0.1], [0.1, 0.2]]}, "numbers"),
        ({"theta_i": [True]}, "type"),
        ({"theta_i": [10.0, 20.0]}, "radians"),
        ({"phi": "0,181"}, "phi"),
        ({"phi": None, "phi_i": "0,360", "phi_o": "0"}, "phi_i = 360 degrees"),
        ({"phi": None, "phi_i": "0,90"}, "either phi"),
        ({"phi": None}, "either phi"),
        ({"phi_i": "0", "phi_o": "0"}, "either phi"),
        ({"cell": "box"}, "cell"),
    ],
)
def test_malformed_axes_are_refused(axes, match):
    with pytest.raises(GridError, match=match) as caught:
        Grid.from_axes(**({"theta_i": "10", "phi": "0,180"} | axes))
    assert "\n" not in str(caught.value)


def test_other_refusals():
    for obj in (7, {"phi": "0"}, {"theta_i": "1", "phi": "0", "psi": "1"}):
        with pytest.raises(GridError, match="grid"):
            Grid.resolve(obj)
    with pytest.raises(GridError, match="cell"):
        Grid.parse("2x2x2", cell="box")
    good = Grid.parse("2x2x2")
    for edges in ([0.0, 1.0], [0.0, 1.5, 1.0], [0.0, 0.1, 1.0], [-1.0, 0.7, 1.0], ["a", "b", "c"]):
        with pytest.raises(GridError, match="theta_i_edges"):
            Grid(good.theta_i, good.theta_o, good.phi, theta_i_edges=edges)
    with pytest.raises(GridError, match="without"):
        Grid(good.theta_i, good.theta_o, good.phi, phi_i_edges=[0.0, 1.0])


def test_polar_counts_of_both_sides_meet_at_the_horizon():
    grid = Grid.parse("2x3+2x4")
    np.testing.assert_allclose(np.degrees(grid.theta_o), [15, 45, 75, 112.5, 157.5], rtol=1e-15)
    np.testing.assert_allclose(np.degrees(grid.theta_o_edges), [0, 30, 60, 90, 135, 180], rtol=1e-15)
    assert grid.below
    assert not grid.square
    assert not Grid.parse("2x3x4").below
    assert Grid.parse("2+2x2+2x4").square
    below = Grid.parse("0+2x2x4")
    np.testing.assert_allclose(np.degrees(below.theta_i_edges), [90, 135, 180], rtol=1e-15)
    points = Grid.parse("2x3+2x4", "point")
    np.testing.assert_allclose(np.degrees(points.theta_o), [0, 45, 90, 180], rtol=1e-15)


def test_edges_between_positions_keep_the_sides_apart():
    grid = Grid.from_axes(theta_i="100,170", theta_o="20,85,130", phi="0")
    np.testing.assert_allclose(np.degrees(grid.theta_i_edges), [90, 135, 180], rtol=1e-15)
    np.testing.assert_allclose(np.degrees(grid.theta_o_edges), [0, 52.5, 90, 180], rtol=1e-15)
    assert Grid.from_json(grid.to_json()) == grid


@pytest.mark.parametrize("text", ["2x2x3+1", "2+x2x3", "2++2x2x3", "2+-1x2x3", "0+0x2x3", "2+2+2x2x3", "+2+2x2x3"])
def test_malformed_counts_of_two_sides_are_refused(text):
    with pytest.raises(GridError) as caught:
        Grid.parse(text)
    assert "\n" not in str(caught.value)
