"""New ramps: from numbers, from a SUMO net, from OpenStreetMap."""
