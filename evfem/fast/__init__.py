"""The fast model: a pad remembered from a few equilibria."""
