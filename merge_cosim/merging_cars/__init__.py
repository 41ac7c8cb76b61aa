"""How the merging car drives."""
