"""Parameters of a scene from measurements: what was measured, what is free, and the fit."""
