"""What estimators learn from data: densities of speeds and times, the model file, fitting."""
