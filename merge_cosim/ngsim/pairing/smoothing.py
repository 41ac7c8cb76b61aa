"""Filters for one gap-free track at 10 Hz: a symmetric one for positions, a causal one for what a host can observe.

NGSIM's positions come from video and jitter by some centimetres, which two differentiations turn into accelerations
that no car has. The symmetric filter takes this out without a lag. It looks ahead, though, so what an estimator sees of
a merging car goes through the causal filter, which at each cycle knows only the cycles up to it.
"""

from functools import cache
from itertools import pairwise

import numpy as np

from merge_cosim.core.units import FloatArray, IntArray


def smooth_position(position: FloatArray, window: int, order: int) -> FloatArray:
    """Smooth positions along the road with a Savitzky-Golay filter; the result never runs backwards.

    Each value becomes that of the polynomial fitted to the `window` cycles around it; at both ends the first and the
    last fit are carried on. The default of the rules, 11 cycles and order 2, has its -3 dB point near 1.3 Hz
    (Schafer 2011), above what a driver does with the pedals and below the jitter. A track shorter than the window is
    fitted with the longest odd window it has room for, and one that no such window fits stays as it is.

    Args:
        position: Logged positions of one track [m], shape (n,).
        window: Length of the fitted stretch [cycles], odd.
        order: Order of the polynomial, less than `window`.

    Returns:
        Smoothed positions [m], shape (n,), non-decreasing: SUMO's cars do not reverse.
    """
    from scipy.signal import savgol_filter  # takes half a second to import, which only new data should cost

    fitting = min(window, len(position) - 1 + len(position) % 2)
    smooth = savgol_filter(position, fitting, order) if fitting > order else position
    return np.maximum.accumulate(np.asarray(smooth, dtype=np.float64))


def smooth_tracks(position: FloatArray, offsets: IntArray, window: int, order: int) -> FloatArray:
    """Smooth tracks that lie end to end, each by itself; track `i` is `position[offsets[i]:offsets[i + 1]]`."""
    smooth = [smooth_position(position[first:end], window, order) for first, end in pairwise(offsets)]
    return np.concatenate([np.empty(0), *smooth])


def filter_causally(values: FloatArray, window: int, order: int) -> FloatArray:
    """Filter `values` with what was known at each cycle: the last value of a polynomial fitted to the latest cycles.

    With order 1 a steady acceleration passes without a lag, and white noise over 11 cycles shrinks to 0.56 of itself.
    Until `window` cycles have been seen, the fit uses those that have (the first value passes unchanged).

    Args:
        values: One track's logged values, shape (n,).
        window: Length of the fitted stretch [cycles].
        order: Order of the polynomial, less than `window`.

    Returns:
        Filtered values, shape (n,); entry `i` depends on `values[:i + 1]` only.
    """
    filtered = np.empty(len(values))
    for seen in range(1, min(window, len(values) + 1)):
        filtered[seen - 1] = values[:seen] @ _last_value_taps(seen, order)
    if len(values) >= window:
        stretches = np.lib.stride_tricks.sliding_window_view(values, window)
        filtered[window - 1 :] = stretches @ _last_value_taps(window, order)
    return filtered


@cache
def _last_value_taps(window: int, order: int) -> FloatArray:
    """Weights that give the last value of a fit to `window` values (of a lower order where these are too few)."""
    from scipy.signal import savgol_coeffs

    taps = savgol_coeffs(window, min(order, window - 1), pos=window - 1, use="dot")
    return np.asarray(taps, dtype=np.float64)
