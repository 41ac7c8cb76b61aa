"""Ramps and encounters in other formats: CommonRoad."""
