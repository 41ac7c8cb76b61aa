"""The base of what TraCI and libsumo call after every step."""

from traci import StepListener

__all__ = ["StepListener"]
