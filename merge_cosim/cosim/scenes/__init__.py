"""Scenes: a SUMO simulation with any traffic in it, whose hosts are driven by a method."""
