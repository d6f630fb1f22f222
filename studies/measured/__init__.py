"""The study `measured`: measurements of others beside predictions in which nothing is fitted to them."""
