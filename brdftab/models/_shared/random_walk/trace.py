"""One random walk over Smith microfacets, recorded vertex by vertex.

With `heights` false a walk is position-free (Wang et al. 2022): it never ends by leaving; the chance to meet the next
facet, Lambda/(1 + Lambda), multiplies its throughput. With `heights` true it is that of Heitz et al. (2016): each
segment ends at a random height h or leaves the surface. Only C1(h), the share of the surface below h, is needed:
log C1 moves by -log(1 - u)/Lambda, so that the height distribution itself cancels.
"""

from __future__ import annotations

import math

from brdftab.jit import kernel
from brdftab.models._shared.fresnel.fresnel import multiply
from brdftab.models._shared.random_walk.normals import visible_normal
from brdftab.models._shared.random_walk.refraction import fresnel, refract
from brdftab.models._shared.random_walk.rng import uniforms
from brdftab.models._shared.random_walk.terms import segment

# columns of a recorded vertex: direction towards where the light comes from, factor of the facet's term, log C1, and
# the side that the light is on (1 above the interface, -1 below)
WX, WY, WZ, FACTOR, HEIGHT, SIDE = range(6)
COLUMNS = 6
# blocks of random numbers from here on decide which dim paths end
_LATE = 1 << 31
# and from here on, which side light takes in walks with heights
_CHOICE = 1 << 30


@kernel
def thin_out(row, chance, limit, seed, cell, path, block):
    """Let a path whose largest throughput times `chance` is below `limit` survive in proportion; raise what survives.

    Returns False where the path ends. The expectation stays what it was (Russian roulette).
    """
    largest = 0.0
    for w in range(row.size):
        largest = max(largest, chance * row[w])
    if largest >= limit:
        return True
    if uniforms(seed, cell, path, _LATE + block)[0] * limit >= largest:
        return False
    for w in range(row.size):
        row[w] *= limit / largest
    return True


@kernel
def arrive(ndf, alpha_x, alpha_y, x, y, z, heights, level, u):
    """Return what a path finds along its direction (x, y, z) of travel: facet factor, chance to meet one, log C1.

    A log C1 of 0 means that the path has left.
    """
    weight, chance = segment(ndf, alpha_x, alpha_y, x, y, z)
    if not heights:
        return weight, (chance if z > 0.0 else 1.0), level
    if z <= 0.0:
        # Lambda = -1/(1 - chance) on the way down
        return weight, 1.0, level + math.log(u) * (1.0 - chance)
    if chance <= 0.0:
        return weight, 0.0, 0.0
    return weight / chance, 1.0, min(level - math.log(u) * (1.0 - chance) / chance, 0.0)


@kernel
def reflections(ndf, alpha_x, alpha_y, x, y, z, fresnel_, heights, limit, most, seed, cell, path, vertices, throughput):
    """Follow one path of light that arrives from (x, y, z) over facets that reflect; returns its number of vertices.

    Parameters
    ----------
    ndf, alpha_x, alpha_y
        Distribution (Beckmann 0, GGX 1) and roughness.
    x, y, z : float
        Unit vector towards the light, z > 0.
    fresnel_ : tuple
        kind, a, b, table of `fresnel.fresnel.multiply`.
    heights : bool
        See the module.
    limit : float
        Throughput below which paths end at random.
    most : int
        Vertices that the arrays hold.
    seed, cell, path : int
        Of the random numbers.
    vertices : ndarray (most, COLUMNS)
        Filled: at vertex k, the direction back along the light, 1/(|z| (1 + Lambda)) of it, log C1.
    throughput : ndarray (most, W)
        Filled: products of F (and of the chances to meet a facet) before vertex k.
    """
    kind, fa, fb, table = fresnel_
    size = throughput.shape[1]
    for w in range(size):
        throughput[0, w] = 1.0
    level = 0.0
    count = 0
    dx, dy, dz = -x, -y, -z
    for k in range(most):
        a, b, c, d = uniforms(seed, cell, path, k)
        weight, chance, level = arrive(ndf, alpha_x, alpha_y, dx, dy, dz, heights, level, d)
        if heights and level >= 0.0:
            break
        if k > 0 and not thin_out(throughput[k], chance, limit, seed, cell, path, k):
            break
        x, y, z = -dx, -dy, -dz
        vertex = vertices[k]
        vertex[WX], vertex[WY], vertex[WZ], vertex[FACTOR], vertex[HEIGHT] = x, y, z, weight, level
        count = k + 1
        if count == most:
            break
        mx, my, mz = visible_normal(ndf, alpha_x, alpha_y, x, y, z, a, b, c)
        cosine = max(x * mx + y * my + z * mz, 0.0)
        for w in range(size):
            throughput[k + 1, w] = chance * throughput[k, w]
        multiply(kind, fa, fb, table, cosine, throughput[k + 1])
        dx, dy, dz = 2.0 * cosine * mx - x, 2.0 * cosine * my - y, 2.0 * cosine * mz - z
        s = 1.0 / math.sqrt(dx * dx + dy * dy + dz * dz)
        dx, dy, dz = dx * s, dy * s, dz * s
    return count


@kernel
def crossed(level):
    """Return log C1 on the other side of the interface, where heights are upside down: C1 -> 1 - C1."""
    return math.log(-math.expm1(level))


@kernel
def scatter(ndf, alpha_x, alpha_y, side, x, y, z, n, a, b, c, d):
    """Draw how a facet sends on light that arrives from (x, y, z): by its Fresnel reflectance it reflects or refracts.

    `n` is the index below, `side` that of the light and a, b, c, d are uniforms. Returns the new direction of travel
    and its side.
    """
    # from below the surface looks as from above after turning every direction round, which D does not mind
    x, y, z = side * x, side * y, side * z
    eta = n if side > 0.0 else 1.0 / n
    mx, my, mz = visible_normal(ndf, alpha_x, alpha_y, x, y, z, a, b, c)
    cosine = max(x * mx + y * my + z * mz, 0.0)
    if d < fresnel(cosine, eta):
        new, p, q = side, 2.0 * cosine, 1.0
    else:
        new, p, q = -side, cosine / eta - refract(cosine, eta), 1.0 / eta
    dx, dy, dz = side * (p * mx - q * x), side * (p * my - q * y), side * (p * mz - q * z)
    s = 1.0 / math.sqrt(dx * dx + dy * dy + dz * dz)
    return dx * s, dy * s, dz * s, new


@kernel
def refractions(ndf, alpha_x, alpha_y, x, y, z, n, heights, limit, most, seed, cell, path, vertices, throughput):
    """Follow one path of light that arrives from (x, y, z), above or below, over facets that reflect and refract.

    As `reflections`, with one column of throughput that holds the chances to meet a facet; `n` is the index below.
    """
    throughput[0, 0] = 1.0
    level = 0.0
    count = 0
    side = 1.0 if z > 0.0 else -1.0
    dx, dy, dz = -x, -y, -z
    for k in range(most):
        a, b, c, d = uniforms(seed, cell, path, k)
        weight, chance, level = arrive(ndf, alpha_x, alpha_y, dx, dy, side * dz, heights, level, d)
        if heights and level >= 0.0:
            break
        if k > 0 and not thin_out(throughput[k], chance, limit, seed, cell, path, k):
            break
        x, y, z = -dx, -dy, -dz
        vertex = vertices[k]
        vertex[WX], vertex[WY], vertex[WZ], vertex[FACTOR], vertex[HEIGHT], vertex[SIDE] = x, y, z, weight, level, side
        count = k + 1
        if count == most:
            break
        throughput[k + 1, 0] = chance * throughput[k, 0]
        # the height has used up this block's last number
        choice = uniforms(seed, cell, path, _CHOICE + k)[0] if heights else d
        dx, dy, dz, new = scatter(ndf, alpha_x, alpha_y, side, x, y, z, n, a, b, c, choice)
        if new != side:
            side, level = new, crossed(level)
    return count
