"""The co-simulation loop: SUMO session, stepping, observing, commanding, scoring."""
