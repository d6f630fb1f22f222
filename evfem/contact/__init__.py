"""Where finger and surface meet: surfaces, pad, attraction, Signorini-Coulomb on the dense compliance."""
