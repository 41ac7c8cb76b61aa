"""Loops compiled by numba; imported when an encounter begins, for numba takes half a second to import."""
