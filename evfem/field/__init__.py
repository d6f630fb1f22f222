"""The full electrostatic field below outlines: meshes, Poisson's problem, columns, bounds."""
