"""Random numbers by counter as `merge_cosim.core.random_streams` gives them, one at a time for compiled loops."""

from math import log, sqrt

import numpy as np

from merge_cosim.core.kernels import kernel
from merge_cosim.core.units import FloatArray

_GOLDEN, _FIRST, _SECOND = (np.uint64(c) for c in (0x9E3779B97F4A7C15, 0xBF58476D1CE4E5B9, 0x94D049BB133111EB))
_A, _B, _C, _UNIT_BITS = (np.uint64(bits) for bits in (30, 27, 31, 11))
_TAIL = 0.13533528323661269189
"""exp(-2): nearer to 0 or 1 than this the quantile is computed from its logarithm."""
_INNER = 1.1
"""Below this (the quantile at `_TAIL` is -1.1015) the formula for the middle has been used rightly."""
_ROOT_TAU = 2.50662827463100050242


@kernel
def uniform(key: np.uint64, place: np.uint64) -> float:
    """Number `place` (from 0) of a stream, uniform on (0, 1)."""
    bits = key + (place + np.uint64(1)) * _GOLDEN
    bits = (bits ^ (bits >> _A)) * _FIRST
    bits = (bits ^ (bits >> _B)) * _SECOND
    bits ^= bits >> _C
    return (float(bits >> _UNIT_BITS) + 0.5) * 2.0**-53


@kernel
def normal(key: np.uint64, place: np.uint64) -> float:
    """Number `place` (from 0) of a stream as a standard normal one."""
    return quantile(uniform(key, place))


@kernel
def normals(key: np.uint64, place: np.uint64, filled: FloatArray) -> None:
    """Fill an array with the numbers from `place` on of a stream as standard normal ones, with few branches."""
    outer, count = np.empty(len(filled), dtype=np.int64), 0
    for i in range(len(filled)):
        filled[i] = _middle(uniform(key, place + np.uint64(i)))
    for i in range(len(filled)):
        outer[count] = i
        count += abs(filled[i]) >= _INNER
    for i in outer[:count]:
        filled[i] = quantile(uniform(key, place + np.uint64(i)))


@kernel
def quantile(share: float) -> float:
    """Quantile of the standard normal distribution (Moshier, Cephes Mathematical Library, `ndtri`, as in SciPy)."""
    upper = share > 1.0 - _TAIL
    y = 1.0 - share if upper else share
    return _middle(y) if y > _TAIL else _outer(y) if upper else -_outer(y)


@kernel
def _middle(y: float) -> float:
    """The quantile of shares that are not near to 0 or 1."""
    y -= 0.5
    z = y * y
    p = (((-5.99633501014107895267e1 * z + 9.80010754185999661536e1) * z - 5.66762857469070293439e1) * z
             + 1.39312609387279679503e1) * z - 1.23916583867381258016e0  # fmt: skip
    q = (((((((z + 1.95448858338141759834e0) * z + 4.67627912898881538453e0) * z + 8.63602421390890590575e1) * z
               - 2.25462687854119370527e2) * z + 2.00260212380060660359e2) * z - 8.20372256168333339912e1) * z
             + 1.59056225126211695515e1) * z - 1.18331621121330003142e0  # fmt: skip
    return (y + y * (z * p / q)) * _ROOT_TAU


@kernel
def _outer(y: float) -> float:
    """How far below 0 the quantile of a share near to 0 is."""
    x = sqrt(-2.0 * log(y))
    z = 1.0 / x
    if x < 8.0:
        p = (((((((4.05544892305962419923e0 * z + 3.15251094599893866154e1) * z + 5.71628192246421288162e1) * z
                + 4.40805073893200834700e1) * z + 1.46849561928858024014e1) * z + 2.18663306850790267539e0) * z
              - 1.40256079171354495875e-1) * z - 3.50424626827848203418e-2) * z - 8.57456785154685413611e-4  # fmt: skip
        q = (((((((z + 1.57799883256466749731e1) * z + 4.53907635128879210584e1) * z + 4.13172038254672030440e1) * z
               + 1.50425385692907503408e1) * z + 2.50464946208309415979e0) * z - 1.42182922854787788574e-1) * z
             - 3.80806407691578277194e-2) * z - 9.33259480895457427372e-4  # fmt: skip
    else:
        p = (((((((3.23774891776946035970e0 * z + 6.91522889068984211695e0) * z + 3.93881025292474443415e0) * z
                + 1.33303460815807542389e0) * z + 2.01485389549179081538e-1) * z + 1.23716634817820021358e-2) * z
              + 3.01581553508235416007e-4) * z + 2.65806974686737550832e-6) * z + 6.23974539184983293730e-9  # fmt: skip
        q = (((((((z + 6.02427039364742014255e0) * z + 3.67983563856160859403e0) * z + 1.37702099489081330271e0) * z
               + 2.16236993594496635890e-1) * z + 1.34204006088543189037e-2) * z + 3.28014464682127739104e-4) * z
             + 2.89247864745380683936e-6) * z + 6.79019408009981274425e-9  # fmt: skip
    return x - log(x) / x - z * p / q
