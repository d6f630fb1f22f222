"""One equilibrium under given loads, by Newton's method on the condensed contact problem.

`state` has what an equilibrium is made of and `strategy` the user's numbers; `control` and `hand` say
what is prescribed. `condensation` factorises, `linearisation` makes the tangent, `interface` the gaps,
slips and their laws, `pressure` the unknown of nearly incompressible tissue; `factorised` is one
iteration with `travel` and `anderson`, and `equilibrium` iterates until a state is accepted. The
algorithm stands in `evfem.solver`, whose steps follow a path of such equilibria.
"""
