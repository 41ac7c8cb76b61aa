"""The co-simulation loop and the worlds that it drives."""
