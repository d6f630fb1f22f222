"""What a scene answers to small changes about its state: stiffness over the frequency."""
