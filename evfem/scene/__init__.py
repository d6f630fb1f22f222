"""What is simulated: motions, weak forms of the user, scenes, their files, and what they need."""
