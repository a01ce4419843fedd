"""How many pairs of directions a kernel gets at once: as many as it evaluates in a blink, however slow they are."""

from __future__ import annotations

from collections.abc import Iterator

from brdftab.timing import Clock

# seconds that a block may take, so that progress is told and an interruption answered soon
LIMIT = 0.4
FIRST, MOST = 1 << 8, 1 << 15
# a block is never mostly set-up: it may take so many times what a call costs without any pair
SET_UP = 4.0


class Pace:
    """Sizes of blocks from the measured times of earlier ones.

    The time of a block is taken for ``fixed + rate * pairs``, from the first block and the latest. Kernels give the
    same values to the last bit in blocks of any size; those that do not get blocks of one size.

    Parameters
    ----------
    steady : bool
        Keep the largest size, whatever the time.
    """

    def __init__(self, steady: bool = False) -> None:
        self.steady = steady
        self.size = MOST if steady else FIRST
        self._first: tuple[int, float] | None = None

    def measure(self, pairs: int, seconds: float) -> None:
        """Take the time of a block into account."""
        if self.steady:
            return
        if self._first is None or pairs < self._first[0]:
            self._first = pairs, seconds
        n, t = self._first
        rate = (seconds - t) / (pairs - n) if pairs > n else seconds / pairs
        rate = max(rate, 0.1 * seconds / pairs, 1e-12)
        fixed = max(seconds - rate * pairs, 0.0)
        wanted = (max(LIMIT, SET_UP * fixed) - fixed) / rate
        # times scatter: grow more slowly than shrink
        self.size = int(min(max(wanted, self.size / 8.0, 1.0), 4.0 * max(pairs, 1), MOST))

    def blocks(self, count: int) -> Iterator[slice]:
        """Yield slices that cover `count` pairs; what the caller does with each is timed."""
        start = 0
        while start < count:
            stop = min(count, start + self.size)
            clock = Clock()
            yield slice(start, stop)
            # a short rest at the end says little about long blocks; whole rows of a table fill more than half a block
            if stop - start >= 0.5 * min(self.size, FIRST):
                self.measure(stop - start, clock.seconds)
            start = stop
