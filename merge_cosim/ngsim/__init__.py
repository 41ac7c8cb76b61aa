"""NGSIM trajectories: reading every published format, pairing cars into encounters."""
