"""Statistics over result rows: summaries with intervals, comparisons on the same cases, and the quality of beliefs."""

from merge_cosim.results.statistics.belief import belief, calibration
from merge_cosim.results.statistics.summary import Summary, oracle_best

__all__ = ["Summary", "belief", "calibration", "oracle_best"]
