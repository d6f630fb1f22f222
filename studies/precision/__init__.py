"""The study `work_precision`: error against time, growth, and where a step's time goes."""
