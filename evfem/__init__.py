"""evfem: a finger pad on an electrovibration display, by finite elements on scikit-fem."""

__version__ = "0.1.0"
