"""Running a scene: model, run, works and energies, results, checkpoints, rendering."""
