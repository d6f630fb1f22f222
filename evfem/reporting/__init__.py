"""A page about a run, for whoever has to judge it."""
