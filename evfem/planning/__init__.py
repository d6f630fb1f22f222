"""What a scene needs, decided before anything is solved, and what is hardly meant by it."""
