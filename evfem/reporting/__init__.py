"""For whoever has to judge a run: what ends it in time, and a page about it."""
