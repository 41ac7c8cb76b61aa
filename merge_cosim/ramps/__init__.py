"""Ramps as SUMO networks: sources, built nets, stations, tiles."""
