"""How what a scene does answers to its parameters: exact derivatives, uncertainty, design."""
