"""RGL tensor files made in tests: the container, and an analytic BRDF as an export with identity or random warp."""

from __future__ import annotations

import struct

import numpy as np

CODES = {"uint8": 1, "uint32": 5, "float32": 10, "float64": 11}


def tensor_bytes(fields, version=(1, 0)):
    """Return the bytes of a tensor file with the given arrays."""
    size = 18 + sum(2 + len(name) + 11 + 8 * array.ndim for name, array in fields.items())
    head, body = b"tensor_file\0" + struct.pack("<BBI", *version, len(fields)), b""
    for name, array in fields.items():
        array = np.ascontiguousarray(array)
        body += bytes(-(size + len(body)) % 8)
        head += struct.pack("<H", len(name)) + name.encode()
        head += struct.pack("<HBQ", array.ndim, CODES[array.dtype.name], size + len(body))
        head += struct.pack(f"<{array.ndim}Q", *array.shape)
        body += array.tobytes()
    return head + body


def text(words):
    """Return text as the u1 array that files use for it."""
    return np.frombuffer(words.encode(), np.uint8)


def identity(f, theta_i, n=24):
    """Return the fields of an export: identity warp, and f (N, 3) cos(theta_o) sampled on n x n half vectors."""
    theta_i = np.asarray(theta_i, np.float32)
    y, x = np.meshgrid(np.linspace(0.0, 1.0, n), np.linspace(0.0, 1.0, n), indexing="ij")
    theta_m, phi_m = 0.5 * np.pi * x * x, 2.0 * np.pi * y - np.pi
    half = np.stack([np.sin(theta_m) * np.cos(phi_m), np.sin(theta_m) * np.sin(phi_m), np.cos(theta_m)], -1)
    planes = []
    for t in theta_i.astype(np.float64):
        light = np.array([np.sin(t), 0.0, np.cos(t)])
        o = 2.0 * (half @ light)[..., None] * half - light
        theta_o = np.arctan2(np.hypot(o[..., 0], o[..., 1]), o[..., 2]).reshape(-1)
        up = theta_o < 0.5 * np.pi
        phi = np.arctan2(o[..., 1], o[..., 0]).reshape(-1)
        values = f(np.full_like(theta_o, t), np.where(up, theta_o, 0.0), phi) * np.cos(theta_o)[:, None]
        planes.append(np.where(up[:, None], values, 0.0).T.reshape(3, n, n))
    one = np.ones((2, 2), np.float32)
    return {
        "description": text("a test"),
        "phi_i": np.zeros(1, np.float32),
        "theta_i": theta_i,
        "sigma": 0.25 * one,
        "ndf": one,
        "vndf": np.ones((1, theta_i.size, 2, 2), np.float32),
        "luminance": np.ones((1, theta_i.size, n, n), np.float32),
        "rgb": np.array(planes, np.float32)[None],
        "jacobian": np.ones(1, np.uint8),
    }


def random_fields(seed=0, slices=4, warp=(9, 12), n=8, jacobian=1):
    """Return the fields of a file whose every array is random and positive, without NaN."""
    rng = np.random.default_rng(seed)

    def draw(*shape):
        return rng.uniform(0.2, 2.0, shape).astype(np.float32)

    return {
        "description": text("random"),
        "phi_i": np.zeros(1, np.float32),
        "theta_i": np.linspace(0.0, 1.5, slices).astype(np.float32),
        # an isotropic file's sigma knows no azimuth
        "sigma": np.repeat(draw(1, 7), 3, axis=0),
        "ndf": draw(5, 6),
        "vndf": draw(1, slices, *warp),
        "luminance": draw(1, slices, n, n),
        "rgb": draw(1, slices, 3, n, n),
        "jacobian": np.array([jacobian], np.uint8),
    }
