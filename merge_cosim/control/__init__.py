"""Controllers of the host."""
