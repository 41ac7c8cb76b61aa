"""Estimators of the merging driver's intention and their learned parts."""
