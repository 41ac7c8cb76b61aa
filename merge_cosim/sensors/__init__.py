"""What the host observes of the merging car."""
