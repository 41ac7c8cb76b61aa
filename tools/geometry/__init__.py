"""Draws the NGSIM ramps to scale: survey, alignment of Local_X/Local_Y, plain XML for netconvert, residuals."""
