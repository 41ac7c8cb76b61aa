"""Scenario files, the sources of their encounters, and methods by name."""
