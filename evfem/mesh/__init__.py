"""The mesh: the container, its quality, its files."""
