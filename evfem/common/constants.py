"""Every constant of the contact and equilibrium solvers in one table.

None of them decides what is accepted: an accepted step satisfies the scene's tolerance whatever
they are. They decide how an equilibrium is found, and how soon. "seen in" names the scenes in
which another value was worse; the groups are those of `evfem study stability`, A and B the scenes
of `evfem study peers`. What a user may change is in `evfem.solver.strategy`.

======================  ========================================================================  ==========
constant                meaning                                                                   seen in
======================  ========================================================================  ==========
SMALLEST_FORCE          forces are compared with the largest reaction, N/mm, or with this
KILOVOLT                squared voltages are counted in kV^2 where they are an unknown
INCOMPRESSIBLE          tissue that is so many times stiffer against volume than in shear has     incom-
                        its pressure as an unknown of the iterations                              pressible
SMALLEST_J              no update shrinks a sampled volume below this ratio                       tissue
SHORTEST_FRACTION       an update that must be cut below this fails the step                      tissue
LARGEST_BONE_INCREMENT  under a prescribed force the bone moves at most this fraction of the      contact
                        body's height in one iteration
SHORTEST_FLIGHT         a body that touches nothing moves in one iteration at least this          attraction
                        fraction of the largest increment
SPARE                   candidates are chosen so many times more than needed, and with            A
                        attractions so many times less steep, as every new choice costs an
                        analysis of the matrix
REACH                   a gap below so many times the step's travel makes a candidate             A
FAR                     so many times as high as the scene's deepest indentation, nodes of the    A
                        undeformed outline become candidates with the first ones
NEIGHBOURS              and so does one below so many node distances once any is chosen           B
STEEP                   an attraction whose negative stiffness exceeds this fraction of the       thin
                        softest shear modulus per height of the body makes its node a candidate   insulators
HELD                    in 3D, the fraction up to which the negative stiffness of an open node    attraction
                        is taken off the tangent: any body holds that
TAKEN                   and the fraction above which it makes the node a candidate                attraction
FIRST                   in 3D, at least this fraction of the pad's nodes are candidates           press
GROWN, GROWING          where they become so many times more within a linear step, it is done     press
                        again with them, at most so often
SMALLEST_STIFFENING     changes of tributary lengths that stiffen no node by more than this       C
                        fraction are left to the iterations
WEAK                    an attraction whose feedback on its own node is below this fraction       C
                        is left to the next iteration
STALLED, SLOW           a residual above the first, or above the second times the last one,       A, B
                        asks for a new factorisation
SHORTER, LONGER         and so does a time step outside these multiples of the one it was         texture
                        made for
STUCK                   a step is given up, after twice as many iterations, if so many of them,   texture
                        the last ones, have no residual below
FALLING                 this fraction of those before
ANDERSON_DEPTH          earlier iterations that are combined                                      A, B
ACTIVE_SET_LIMIT        solves of an active set                                                   attraction
DISC_OWN                a node's own compliance counts as no less than this fraction of the mean  attraction
STABLE                  fraction of the critical negative stiffness that is used if the           attraction
                        attraction weakens with the gap faster than the tissue stiffens
LEFT_OVER               least share of a contact force that the tangent leaves where the          attraction
                        attraction between rough faces grows as fast as it
ROUNDING                violations below this fraction of the largest force are rounding
FIELD_ROUNDING          forces of the full field are known to this fraction of the largest nodal    full field
                        one: changes of 1e-15 mm change them by 4e-13 to 1.4e-10 of it
SMALLEST_PIVOT          pivots of the bone below this fraction belong to a body without a hold
TURNED                  a bone that moved less than this fraction of its next way has not moved   turns
                        along it
PIN_OFFSET              how far inside the rougher side a node is pinned to a jump of friction,   jumps
                        mm: far above rounding, far below any mesh
NEAR                    a slip that has changed by less than this fraction of it in one           rates
                        iteration is near the end
BACK                    a node's speed goes to and fro if it changes back by at least this        rates
                        fraction of its last change
SHORT_RAMP              ramps of friction shorter than this fraction of a node distance are       jumps
                        jumps to a node that crosses them in one iteration
CHANGES                 so many changes of side in one step show that neither side is             jumps
                        consistent
SHORTEST_LENGTH         penalties take tributary lengths as at least this fraction of a node
                        distance
PATH_FIRST              where the error of the path decides, the first part of a scene, as a      press
                        fraction of its first step
PATH_CHANGE             a part is at most so many times as long as the one before where the
                        error of the path decides, or as much shorter; that part times
PATH_SAFETY             this is tried
RELEASED                a part of a step, so small and still failing, is the place of the first       snaps
                        release
COARSER                 after a release the next one within the same step comes at a part so      texture
                        many times as long
DRAG_CHANGE             factor by which the rate of drag of a released body falls, and rises        snaps
DRAG_GROWTH             where its speed grows less or more than these factors in one step
DRAG_REST               drag of a rate below this is nearly none: a body that slows down may      snaps
                        be at rest
DRAG_CALMER             what was not at rest is asked again at so much less drag
DRAG_LEAST              smallest rate of drag; a body that rests only with it ends the release    snaps
DRAG_MOST               largest rate of drag; a step that fails with it is no snap
IMPERFECTION            a release begins so far aside, mm: far above what iterations leave, far   crests
                        below what is seen
DRAG_STEPS              steps of a release, failed ones included, before it is given up             snaps
CRITICAL, SOFTENED      a step that failed where what takes stability away grows so fast,         snaps
                        relative to what holds it, has no equilibrium near; the second, where
                        the body gave way in its iterations
STAGGERED_LIMIT         rounds of the staggered coupling
NAMED                   so many of the largest out-of-balance forces are named in a failure
======================  ========================================================================  ==========
"""

SMALLEST_FORCE = 1e-6
KILOVOLT = 1000.0
INCOMPRESSIBLE = 100.0
SMALLEST_J = 0.05
SHORTEST_FRACTION = 1.0 / 64.0
LARGEST_BONE_INCREMENT = 0.05
SHORTEST_FLIGHT = 1.0 / 16.0
SPARE = 1.5
REACH = 1.2
FAR = 1.3
NEIGHBOURS = 4.0
STEEP = 0.02
HELD, TAKEN = 2.0, 10.0
FIRST, GROWN, GROWING = 0.05, 3.0, 4
SMALLEST_STIFFENING = 0.01
WEAK = 1e-4
STALLED, SLOW = 0.1, 0.5
SHORTER, LONGER = 0.67, 1.5
STUCK = 8
FALLING = 0.9
ANDERSON_DEPTH = 3
ACTIVE_SET_LIMIT = 60
DISC_OWN = 0.1
STABLE = 0.9
LEFT_OVER = 0.01
ROUNDING = 1e-12
FIELD_ROUNDING = 2e-10
SMALLEST_PIVOT = 1e-10
TURNED = 1e-9
PIN_OFFSET = 1e-9
NEAR = 0.3
BACK = 0.5
SHORT_RAMP = 0.5
CHANGES = 3
SHORTEST_LENGTH = 1e-3
PATH_FIRST, PATH_CHANGE, PATH_SAFETY = 1.0 / 16.0, 4.0, 0.9
RELEASED = 1.0 / 32.0
COARSER = 4.0
DRAG_CHANGE, DRAG_GROWTH = 2.0, (1.25, 2.0)
DRAG_REST, DRAG_CALMER = 0.01, 0.1
DRAG_LEAST, DRAG_MOST, DRAG_STEPS = 1e-9, 1e6, 400
IMPERFECTION = 1e-5
CRITICAL, SOFTENED = 0.9, 0.5
STAGGERED_LIMIT = 60
NAMED = 3
