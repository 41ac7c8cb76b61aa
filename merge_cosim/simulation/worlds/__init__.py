"""Worlds: what moves the cars of a simulation."""
