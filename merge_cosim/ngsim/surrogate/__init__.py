"""The surrogate: SUMO's own traffic at an NGSIM site, in NGSIM's format."""
