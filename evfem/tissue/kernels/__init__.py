"""Compiled twins of the weak forms on blocks of cells; evfem[fast] alone imports them."""
