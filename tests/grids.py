"""Small grids for tests of every model: three axes, or four where azimuths count one by one; and cheap settings."""

import math

import numpy as np

import brdftab
from brdftab import models


def grid_of(model, three, four):
    """Return the grid that goes with the model's declaration."""
    return four if models.spec(model).grain else three


# what a table is traced with whatever its tolerance, and blurs that a coarse cell can average
CHEAP = {"bins": 32, "rays": 512, "psi": math.radians(20.0)}


def cheap(model):
    """Return settings with which points and tables of a traced model are the same function, and not a narrow one."""
    return {name: value for name, value in CHEAP.items() if models.spec(model).has(name)}


def swapped(table):
    """Return the values of a square table with light and view swapped."""
    return table.values.transpose((1, 0, 2, 3) if table.grid.isotropic else (2, 3, 0, 1, 4))


def evaluated(model, table, **more):
    """Return the model's values at the positions of a table."""
    names = table.grid.axis_names
    mesh = dict(zip(names, np.meshgrid(*(table.grid.axes[n] for n in names), indexing="ij"), strict=True))
    phi_i = mesh.get("phi_i", 0.0)
    phi = mesh["phi"] if table.grid.isotropic else mesh["phi_o"] - phi_i
    return brdftab.evaluate(model, mesh["theta_i"], mesh["theta_o"], phi, phi_i=phi_i, **more)
