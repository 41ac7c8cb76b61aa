"""From trajectories to encounters: tracks, pairs, windows, filters, splits."""
