"""Timings: against SUMO's bare steps, against simple alternatives, and by cases and processes."""
