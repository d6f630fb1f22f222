"""Textures: a library, what a finger feels of them, and the voltage that renders them."""
