"""One equilibrium under given loads, by Newton's method on the condensed contact problem.

`control` and `hand` say what is prescribed, `condensation` factorises, `linearisation` makes the tangent,
`interface` has gaps, slips and their laws, `pressure` the unknown of nearly incompressible tissue;
`factorised` is one iteration with `travel` and `anderson`, and `equilibrium` iterates until a state is
accepted.
"""
