"""Statistics over result rows: summaries with intervals, comparisons on the same cases, and the quality of beliefs."""

from merge_cosim.results.statistics.belief import belief, calibration
from merge_cosim.results.statistics.summary import oracle_best, strata, summarise

__all__ = ["belief", "calibration", "oracle_best", "strata", "summarise"]
