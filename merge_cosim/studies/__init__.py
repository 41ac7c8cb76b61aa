"""Studies on top of sweeps: bounds, judging of models, training, the reproduction of the papers."""
