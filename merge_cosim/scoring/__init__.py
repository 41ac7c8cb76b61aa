"""From the recorded tracks of an encounter to its measures: failure, gaps, times, decisions."""
