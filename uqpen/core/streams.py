"""Random generators, each with a key for its purpose.

A generator's stream follows from the study's seed and from names (a design, a purpose, a
replicate, a block), never from the order in which generators are made. So neither a further design
of the study nor workers and interruptions change the points of a design.
"""

from __future__ import annotations

import hashlib
import json

import numpy as np

# Each block of this number of points has its own generator, on every machine. A larger design
# then keeps the points of a smaller one.
BLOCK = 65_536


class Stream:
    """A place in the tree of random streams.

    Parameters
    ----------
    seed : int
        Non-negative, of any size.
    *path : str or int
        The purpose of the stream, from the general to the particular.

    Examples
    --------
    >>> points = Stream(5876, "designs", "monte_carlo")
    >>> first = points.generator("points", 0).random()
    >>> first == Stream(5876, "designs", "monte_carlo", "points", 0).generator().random()
    True
    """

    def __init__(self, seed: int, *path: str | int) -> None:
        self.seed = seed
        self.path = path

    def child(self, *path: str | int) -> Stream:
        """Return the stream at `path` below this one, for a caller with generators of its own."""
        return Stream(self.seed, *self.path, *path)

    def generator(self, *path: str | int) -> np.random.Generator:
        """Make a generator for the stream at `path`, always the same one for the same names."""
        # JSON keeps ("a", 1) apart from ("a1",); SHA-256 spreads alike names over the seeds.
        key = json.dumps([*self.path, *path], ensure_ascii=True).encode("ascii")
        digest = np.frombuffer(hashlib.sha256(key).digest(), dtype="<u4")
        words = [self.seed, *(int(word) for word in digest)]
        return np.random.Generator(np.random.PCG64DXSM(np.random.SeedSequence(words)))
