"""Scenarios, sweeps, result store, statistics, training."""
