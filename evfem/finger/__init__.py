"""The finger pad: outline with ridges, layers, structured quadrilaterals, presets."""
