"""The plan of a scene, made before anything is solved, and warnings about implausible input."""
