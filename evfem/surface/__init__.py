"""What the finger touches and what of it touches: profiles, friction, the outline of the pad."""
