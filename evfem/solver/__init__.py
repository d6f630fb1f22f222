"""Equilibrium steps: state, factorisation, linearisation, iteration, adaptive parts."""
