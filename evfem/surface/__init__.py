"""The two faces in contact: profiles of the surface, friction, the outline of the pad."""
