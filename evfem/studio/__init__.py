"""The studio: a page in the browser that turns a texture into a voltage, served on this machine."""
