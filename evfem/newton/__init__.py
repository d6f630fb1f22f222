"""One equilibrium under prescribed loads, by Newton's method on the condensed contact problem.

`control` says what is prescribed, `condensation` factorises, `linearisation` makes the tangent, `interface`
has contact kinematics and conditions, `pressure` the unknown of nearly incompressible tissue; `factorised`
is one iteration with `travel` and `anderson`, and `equilibrium` iterates until a state is accepted.
"""
