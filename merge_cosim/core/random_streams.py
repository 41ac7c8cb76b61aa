"""Random numbers by counter: each encounter has its own stream, independent of the others in the batch.

The i-th number of a stream is a hash of the stream's key and i (SplitMix64: Steele, Lea, Flood, Fast splittable
pseudorandom number generators, OOPSLA 2014), so whole batches are drawn at once and no generator objects are kept.
"""

from __future__ import annotations

import hashlib
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from merge_cosim.core.units import AnyArray, FloatArray, IntArray

Keys = NDArray[np.uint64]

_GOLDEN, _FIRST, _SECOND = (np.uint64(c) for c in (0x9E3779B97F4A7C15, 0xBF58476D1CE4E5B9, 0x94D049BB133111EB))
_STEPS = tuple(np.uint64(bits) for bits in (30, 27, 31))
_UNIT_BITS, _UNIT = np.uint64(11), 2.0**-53


def stream_keys(names: AnyArray, seed: int) -> Keys:
    """Return the key of each name's stream under a seed, shape (n,): the same for the same name at any index."""
    return np.frombuffer(_digests(tuple(names.tolist()), seed), dtype="<u8").astype(np.uint64)


@lru_cache(maxsize=4)  # method after method runs on the same cases
def _digests(names: tuple[str, ...], seed: int) -> bytes:
    return b"".join(hashlib.blake2b(f"{seed}/{name}".encode(), digest_size=8).digest() for name in names)


def derived_keys(keys: Keys, purpose: str) -> Keys:
    """Return the keys of further streams of the same encounters, one for each purpose, shape (n,)."""
    salt = np.frombuffer(hashlib.blake2b(purpose.encode(), digest_size=8).digest(), dtype="<u8").astype(np.uint64)
    return _mixed(keys ^ salt)


def uniform(keys: Keys, first: IntArray, count: int) -> FloatArray:
    """Return numbers `first` to `first + count - 1` of each stream, uniform on (0, 1).

    Args:
        keys: Keys of the streams, shape (n,).
        first: Where to begin in each stream, shape (n,).
        count: How many numbers to take of each.

    Returns:
        Shape (n, count).
    """
    place = first.astype(np.uint64)[:, None] + np.arange(1, count + 1, dtype=np.uint64)
    mixed = _mixed(np.add(keys[:, None], place * _GOLDEN, dtype=np.uint64))
    return ((mixed >> _UNIT_BITS).astype(np.float64) + 0.5) * _UNIT


def _mixed(bits: Keys) -> Keys:
    """SplitMix64's finalizer, of an array of any shape."""
    mixed: Keys = (bits ^ (bits >> _STEPS[0])) * _FIRST
    mixed = (mixed ^ (mixed >> _STEPS[1])) * _SECOND
    mixed ^= mixed >> _STEPS[2]
    return mixed


def normal(keys: Keys, first: IntArray, count: int) -> FloatArray:
    """Return standard normal numbers of each stream (the quantiles of `uniform`), shape (n, count)."""
    from scipy.special import ndtri

    numbers: FloatArray = ndtri(uniform(keys, first, count))
    return numbers
