"""Many scenes: samples, plan files, folders, processes."""
