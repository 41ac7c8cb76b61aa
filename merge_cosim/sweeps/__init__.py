"""Sweeps: plan, tasks, executors, resuming."""
