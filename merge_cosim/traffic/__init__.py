"""How the merging car drives; SUMO's own traffic."""
