"""What a finger feels of a texture: estimated from a database, or by the model, and the voltage for it."""
