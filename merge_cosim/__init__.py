"""merge-cosim: SUMO co-simulation of freeway on-ramp merging between an autonomous host and a human driver."""

__version__ = "0.2.0"
