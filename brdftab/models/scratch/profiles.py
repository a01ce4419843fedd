"""Cross-sections of scratches as piecewise parabolas: analytic shapes by name, and measured heights.

A profile lives on x in [-1, 1] (half the width is the unit of length) with y = 0 the untouched surface, which is its
highest point at both ends: what enters between them stays between them until it leaves upwards. Every smooth profile is
a C1 quadratic spline, so that one tracer serves all; flat pieces would make spikes in the exit directions.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from brdftab.errors import FileFormatError, ParameterError, proposal
from brdftab.models.scratch.bounds import PROFILES
from brdftab.typing import Array

# parabolas of an analytic profile: slopes good to 1e-5 of their range
PIECES = 512
DEEPEST = 100.0


@dataclass(frozen=True, eq=False)
class Profile:
    """A groove's cross-section.

    Attributes
    ----------
    text : str
        What it was made from, as ``quartic:1``.
    knots : float64 (N + 1,)
        Where the parabolas meet, from -1 to 1, increasing.
    height, slope, bend : float64 (N,)
        y = height + slope u + bend u^2 with u = x - knots[n] on piece n.
    symmetric : bool
        True where y(-x) = y(x), so that half of the directions follow from the other half.
    depth : float
        Of the lowest point, in half widths.
    """

    text: str
    knots: Array
    height: Array
    slope: Array
    bend: Array
    symmetric: bool
    depth: float

    def __repr__(self) -> str:
        return f"Profile({self.text}, {self.height.size} parabolas, {self.depth:.6g} half widths deep)"

    def at(self, x: Array) -> tuple[Array, Array]:
        """Return heights and slopes at positions x in [-1, 1]."""
        x = np.asarray(x, dtype=np.float64)
        n = np.clip(np.searchsorted(self.knots, x, side="right") - 1, 0, self.height.size - 1)
        u = x - self.knots[n]
        return self.height[n] + u * (self.slope[n] + u * self.bend[n]), self.slope[n] + 2.0 * u * self.bend[n]


def _of_pieces(text: str, knots: Array, height: Array, slope: Array, bend: Array, symmetric: bool) -> Profile:
    """Build a profile and find its depth."""
    width = np.diff(knots)
    lowest = np.minimum(height, height + width * (slope + width * bend))
    turn = np.divide(-0.5 * slope, bend, out=np.zeros_like(slope), where=bend > 0.0)
    inside = (bend > 0.0) & (turn > 0.0) & (turn < width)
    lowest = np.where(inside, height + 0.5 * turn * slope, lowest)
    return Profile(text, knots, height, slope, bend, symmetric, float(-lowest.min()))


def _spline(text: str, knots: Array, height: Callable[[Array], Array], slope: Callable[[Array], Array]) -> Profile:
    """Return the C1 spline with heights and slopes of a smooth profile at the knots: two parabolas an interval."""
    h, s = height(knots), slope(knots)
    width = np.diff(knots)
    middle = 0.5 * (knots[:-1] + knots[1:])
    # the slope in the middle that two parabolas of equal width need to meet both ends
    centre = 2.0 * np.diff(h) / width - 0.5 * (s[:-1] + s[1:])
    first = h[:-1], s[:-1], (centre - s[:-1]) / width
    rise = 0.25 * width * (s[:-1] + centre)
    second = h[:-1] + rise, centre, (s[1:] - centre) / width
    every = np.empty(2 * width.size + 1)
    every[0::2], every[1::2] = knots, middle
    heights, slopes, bends = (np.stack([a, b], axis=1).ravel() for a, b in zip(first, second, strict=True))
    return _of_pieces(text, every, heights, slopes, bends, True)


def flat() -> Profile:
    """Return the profile of an untouched surface: a mirror."""
    zero = np.zeros(1)
    return _of_pieces("flat", np.array([-1.0, 1.0]), zero, zero, zero, True)


def quartic(depth: float) -> Profile:
    """Return y = -depth (1 - x^2)^2, which meets the surface without an edge."""
    knots = np.linspace(-1.0, 1.0, PIECES // 2 + 1)
    text = f"quartic:{depth:g}"
    return _spline(
        text, knots, lambda x: -depth * (1.0 - x * x) ** 2, lambda x: 4.0 * depth * x * (1.0 - x * x)
    )  # fmt: skip


def vee(half_angle: float) -> Profile:
    """Return two flat walls that enclose twice the half angle (degrees): 90 is flat, 45 a right angle."""
    depth = 1.0 / math.tan(math.radians(half_angle)) if half_angle < 90.0 else 0.0
    knots = np.array([-1.0, 0.0, 1.0])
    text = f"v:{half_angle:g}"
    return _of_pieces(text, knots, np.array([0.0, -depth]), np.array([-depth, depth]), np.zeros(2), True)


def rounded(depth: float, exponent: float) -> Profile:
    """Return y = -depth (1 - |x|^exponent): a flat bottom with rounded corners."""
    # corners sharpen towards the edges
    knots = np.sin(np.linspace(-0.5 * math.pi, 0.5 * math.pi, PIECES // 2 + 1))
    knots[0], knots[PIECES // 4], knots[-1] = -1.0, 0.0, 1.0
    return _spline(
        f"u:{depth:g}:{exponent:g}",
        knots,
        lambda x: -depth * (1.0 - np.abs(x) ** exponent),
        lambda x: depth * exponent * np.sign(x) * np.abs(x) ** (exponent - 1.0),
    )


def ellipse(depth: float) -> Profile:
    """Return the lower half of an ellipse, walls vertical at the edges; depth 1 is a half circle."""
    knots = np.sin(np.linspace(-0.5 * math.pi, 0.5 * math.pi, PIECES + 1))
    knots[0], knots[PIECES // 2], knots[-1] = -1.0, 0.0, 1.0
    angle = np.linspace(-0.5 * math.pi, 0.5 * math.pi, PIECES + 1)
    h = -depth * np.cos(angle)
    width = np.diff(knots)
    chord = np.diff(h) / width
    # parabolas through neighbouring knots; at the edges the slope has no end, so the chord must do
    ends = np.empty(knots.size)
    ends[1:-1] = depth * np.tan(angle[1:-1])
    ends[0], ends[-1] = 2.0 * chord[0] - ends[1], 2.0 * chord[-1] - ends[-2]
    bend = (ends[1:] - ends[:-1]) / (2.0 * width)
    slope = chord - bend * width
    return _of_pieces(f"ellipse:{depth:g}", knots, h[:-1], slope, bend, True)


def measured(heights: Array, text: str = "heights") -> Profile:
    """Return the periodic C1 quadratic spline of heights at equal steps, wrapped at its highest point.

    Parameters
    ----------
    heights : ndarray (N,)
        Heights at the centres of N equal steps across one scratch and its shoulders, N >= 8; any unit, the same as
        half the width, which is 1.
    text : str
        Name in files and errors.

    Raises
    ------
    ParameterError
        If there are fewer than 8, or one is not finite.
    """
    c = np.asarray(heights, dtype=np.float64)
    if c.ndim != 1 or c.size < 8:
        raise ParameterError(f"profile = {text} has heights of shape {c.shape}; give one row of at least 8 numbers")
    if not np.isfinite(c).all():
        at = int(np.flatnonzero(~np.isfinite(c))[0])
        raise ParameterError(f"profile = {text} holds {c[at]} at number {at + 1}; every height must be finite")
    if c.max() == c.min():
        return _of_pieces(text, *_flat_pieces(), True)
    step = 2.0 / c.size
    if (c.max() - c.min()) > DEEPEST:
        raise ParameterError.out_of_range(
            "profile", f"{text} of depth {c.max() - c.min():g}", f"(0, {DEEPEST:g}] half widths", "scale the heights"
        )
    before, after = np.roll(c, 1), np.roll(c, -1)
    # uniform quadratic B-spline: piece n lies over step n, local coordinate f in [0, 1]
    p0, p1, p2 = 0.5 * (before + c), c - before, 0.5 * (before - 2.0 * c + after)
    turn = np.divide(-0.5 * p1, p2, out=np.zeros_like(p1), where=p2 != 0.0)
    turn = np.clip(turn, 0.0, 1.0)
    tops = p0 + turn * (p1 + turn * p2)
    n = int(np.argmax(tops))
    f, top = float(turn[n]), float(tops[n])
    order = (n + np.arange(c.size + 1)) % c.size
    start = np.zeros(c.size + 1)
    start[0] = f
    end = np.ones(c.size + 1)
    end[-1] = f
    kept = end > start
    order, start, end = order[kept], start[kept], end[kept]
    a, b, d = p0[order], p1[order], p2[order]
    height = a + start * (b + start * d) - top
    knots = np.concatenate([[0.0], np.cumsum(end - start)])
    knots = -1.0 + 2.0 * knots / knots[-1]
    knots[-1] = 1.0
    pieces = height, (b + 2.0 * start * d) / step, d / (step * step)
    middle = c[order]
    symmetric = bool(f in (0.0, 1.0) and np.array_equal(middle, middle[::-1]))
    return _of_pieces(text, knots, *pieces, symmetric)


def _flat_pieces() -> tuple[Array, Array, Array, Array]:
    zero = np.zeros(1)
    return np.array([-1.0, 1.0]), zero, zero, zero


def _load(path: Path) -> Array:
    """Return the numbers of an .npy file; raises ValueError."""
    try:
        return np.asarray(np.load(path, allow_pickle=False), dtype=np.float64)
    except (ValueError, EOFError, TypeError):
        # numpy proposes to trust the file
        raise ValueError("damaged or no .npy of numbers") from None


def read_heights(path: str | Path) -> Array:
    """Return the heights in an .npy file, or in a text file: one column of heights, or x and height.

    With two columns the heights are interpolated linearly at as many equal steps over the range of x, and both are
    scaled so that half that range is 1.

    Raises
    ------
    FileFormatError
        If the file holds no such numbers, or x does not increase.
    ParameterError
        If it cannot be opened.
    """
    name = Path(path)
    try:
        if name.suffix.lower() == ".npy":
            data = _load(name)
        else:
            text = name.read_text(encoding="utf-8").replace(",", " ").replace(";", " ")
            rows = [row for row in text.splitlines() if row.partition("#")[0].strip()]
            if not rows:
                raise ValueError("no numbers")
            data = np.loadtxt(rows, comments="#", ndmin=2)
        data = np.atleast_1d(np.squeeze(np.asarray(data, dtype=np.float64)))
    except OSError as error:
        raise ParameterError(
            f"profile = file:{path} cannot be opened ({error.strerror or error}); check the path"
        ) from error
    except (ValueError, EOFError) as error:
        raise FileFormatError(
            f"{path}: is not a list of heights ({error}); give one or two columns of numbers"
        ) from error
    if data.ndim == 1:
        return data
    if data.ndim != 2 or min(data.shape) != 2:
        raise FileFormatError(f"{path}: has shape {data.shape}; give one column of heights, or two: x and height")
    x, y = data.T if data.shape[1] == 2 else data
    if not np.isfinite(x).all() or not (np.diff(x) > 0.0).all():
        at = int(np.flatnonzero(~(np.diff(x) > 0.0))[0]) + 2 if x.size > 1 else 1
        raise FileFormatError(f"{path}: x does not increase at row {at}; sort the rows and drop repeated ones")
    half = 0.5 * (x[-1] - x[0])
    centres = x[0] + 2.0 * half * (np.arange(x.size) + 0.5) / x.size
    return np.interp(centres, x, y) / half


def _number(word: str, name: str, low: float, high: float, valid: str) -> float:
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not low <= value <= high:
        raise ParameterError.out_of_range("profile", name, valid, f"forms are {PROFILES}")
    return value


def parse(text: str) -> Profile:
    """Return the profile that a string names.

    Parameters
    ----------
    text : str
        ``quartic:DEPTH``, ``v:HALF_ANGLE`` (degrees), ``u:DEPTH[:EXPONENT]``, ``ellipse:DEPTH`` (depths in half
        widths), ``flat``, or ``file:PATH`` of measured heights.

    Raises
    ------
    ParameterError
        If there is no such form, a number is out of range, or the file cannot be opened.
    FileFormatError
        If the file holds no heights.
    """
    form, _, rest = text.partition(":")
    words = rest.split(":") if rest else []
    depths = f"a depth in [0, {DEEPEST:g}] half widths"
    if form == "flat" and not words:
        return flat()
    if form == "file" and rest:
        return measured(read_heights(rest), text)
    if form in ("quartic", "ellipse", "u") and len(words) in ((1, 2) if form == "u" else (1,)):
        depth = _number(words[0], text, 0.0, DEEPEST, depths)
        exponent = _number(words[1], text, 2.0, 100.0, "an exponent in [2, 100]") if len(words) == 2 else 4.0
        if depth == 0.0:
            return flat()
        return {"quartic": quartic, "ellipse": ellipse, "u": lambda d: rounded(d, exponent)}[form](depth)
    if form == "v" and len(words) == 1:
        least = math.degrees(math.atan(1.0 / DEEPEST))
        angle = _number(words[0], text, least, 90.0, f"a half angle in [{least:.2g}, 90] degrees")
        return flat() if angle == 90.0 else vee(angle)
    near = proposal(form, ("quartic", "ellipse", "u", "v", "flat", "file"))
    raise ParameterError(f"profile = {text} is not known; {near}{'G' if near else 'g'}ive {PROFILES}")
