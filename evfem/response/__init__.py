"""How what a scene does answers to its parameters and to small motions: exact derivatives, impedance."""
