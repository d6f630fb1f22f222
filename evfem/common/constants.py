"""Every constant of the contact and equilibrium solvers.

None of them decides what is accepted: an accepted step satisfies the scene's tolerance whatever
they are. They decide how an equilibrium is found, and how soon. Brackets name the scenes in
which another value was worse; the groups are those of `evfem study stability`, A and B the scenes
of `evfem study peers`. What a user may change is in `evfem.newton.strategy`.
"""

#: forces are compared with the largest reaction, N/mm, or with this
SMALLEST_FORCE = 1e-6
#: squared voltages are counted in kV^2 where they are an unknown
KILOVOLT = 1000.0
#: tissue that is so many times stiffer against volume than in shear has its pressure as an unknown of the
#: iterations [incompressible]
INCOMPRESSIBLE = 100.0
#: no update shrinks a sampled volume below this ratio [tissue]
SMALLEST_J = 0.05
#: an update that must be cut below this fails the step [tissue]
SHORTEST_FRACTION = 1.0 / 64.0
#: under a prescribed force the bone moves at most this fraction of the body's height in one iteration
#: [contact]
LARGEST_BONE_INCREMENT = 0.05
#: a body that touches nothing moves in one iteration at least this fraction of the largest increment
#: [attraction]
SHORTEST_FLIGHT = 1.0 / 16.0
#: candidates are chosen so many times more than needed, and with attractions so many times less steep, as
#: every new choice costs an analysis of the matrix [A]
SPARE = 1.5
#: a gap below so many times the step's travel makes a candidate [A]
REACH = 1.2
#: so many times as high as the scene's deepest indentation, nodes of the undeformed outline become candidates
#: with the first ones [A]
FAR = 1.3
#: and so does one below so many node distances once any is chosen [B]
NEIGHBOURS = 4.0
#: an attraction whose negative stiffness exceeds this fraction of the softest shear modulus per height of the
#: body makes its node a candidate [thin insulators]
STEEP = 0.02
#: in 3D, the fraction up to which the negative stiffness of an open node is taken off the tangent: any body
#: holds that [attraction]
SUBTRACTED = 2.0
#: and the fraction above which it makes the node a candidate [attraction]
STEEP_IN_SPACE = 10.0
#: in 3D, at least this fraction of the pad's nodes are candidates [press]
FIRST_CANDIDATES = 0.05
#: where they become so many times more within a linear step, it is done again with them, at most so often
#: [press]
CANDIDATE_GROWTH, CANDIDATE_ROUNDS = 3.0, 4
#: changes of tributary lengths that stiffen no node by more than this fraction are left to the iterations [C]
SMALLEST_STIFFENING = 0.01
#: an attraction whose feedback on its own node is below this fraction, by dimension, is left to the next
#: iteration: in 3D nodes that take part cost more than iterations [C, press]
WEAK = {2: 1e-4, 3: 1e-2}
#: a residual above the first, or above the second times the last one, asks for a new factorisation [A, B]
STALLED, SLOW = 0.1, 0.5
#: and so does a time step outside these multiples of the one it was made for [texture]
SHORTER, LONGER = 0.67, 1.5
#: a step is given up, after twice as many iterations, if so many of them, the last ones, have no residual
#: below [texture]
STUCK = 8
#: this fraction of those before
FALLING = 0.9
#: earlier iterations that are combined [A, B]
ANDERSON_DEPTH = 3
#: dense systems of so many unknowns are factorised in single precision and refined; half or twice of this,
#: `OLD_FACTORS`, `LARGE_SCHUR` or `INNER` change a small tip's time by less than it varies, 10 % [space]
LARGE_SYSTEM = 300
#: factors of an earlier matrix serve while each round of refinement leaves less than this fraction of the
#: residual, a matrix's own while it leaves less than twice that [space]
OLD_FACTORS = 0.2
#: refined is what leaves this fraction of the right-hand side, in at most so many rounds
REFINED, REFINEMENTS = 1e-14, 14
#: rows of a matrix that are copied at once
BLOCK = 64
#: a tangent with so many kept unknowns is factorised in single precision, as few are in the plane, where that
#: gains nothing [space]
LARGE_SCHUR = 1000
#: and so is one of so many unknowns, in the plane by own factors: x 1.4 to 1.5 on L2, x 0.98 where that
#: is refused once [A, B]; in space a factorisation then costs as much as ten iterations and more
LARGE_BODY = 30_000
#: such a body in space keeps so many times as many candidates as are needed, once nodes touch, as every new
#: choice costs an analysis [ridged tips]; of small bodies under a strong attraction steps were cut
KEPT = 2.5
#: while their compliance takes less than this fraction of the operations of the factorisation [whorls]
CHEAP = 0.5
#: and its residuals are judged by the mean rate of so many iterations: single ones stall [ridged tips]
RATES = 3
#: where factors of single precision give the motion under equal forces to this fraction [space]
ACCURATE = 1e-3
#: contact in space is solved to this fraction of the residual of the iterate; from 1e-2 on the next residual
#: falls so slowly that factorisations are made anew (a tip under a voltage: 13 instead of 3) [space]
INNER = 1e-3
#: solves of an active set; of 8,600 in drawn scenes 44 need more, and then an attraction scaled down serves
#: [attraction]
ACTIVE_SET_LIMIT = 30
#: a node's own compliance counts as no less than this fraction of the mean [attraction]
DISC_OWN = 0.1
#: fraction of the critical negative stiffness that is used if the attraction weakens with the gap faster than
#: the tissue stiffens [attraction]
STABLE = 0.9
#: least fraction of a contact force that the tangent leaves where the attraction between rough faces grows as
#: fast as it [attraction]
LEFT_OVER = 0.01
#: violations below this fraction of the largest force are rounding
ROUNDING = 1e-12
#: forces of the full field are known to this fraction of the largest nodal one: changes of 1e-15 mm change
#: them by 4e-13 to 1.4e-10 of it [full field]
FIELD_ROUNDING = 2e-10
#: pivots of the bone below this fraction belong to a body without a hold
SMALLEST_PIVOT = 1e-10
#: a bone displacement below this fraction of the next one counts as none along it [turns]
TURNED = 1e-9
#: how far inside the rougher side a node is pinned to a jump of friction, mm: far above rounding, far below
#: any mesh [jumps]
PIN_OFFSET = 1e-9
#: a slip that has changed by less than this fraction of it in one iteration is near the end [rates]
NEAR = 0.3
#: a node's speed goes to and fro if it changes back by at least this fraction of its last change [rates]
BACK = 0.5
#: ramps of friction shorter than this fraction of a node distance are jumps to a node that crosses them in
#: one iteration [jumps]
SHORT_RAMP = 0.5
#: so many changes of side in one step show that neither side is consistent [jumps]
CHANGES = 3
#: penalties take tributary lengths as at least this fraction of a node distance
SHORTEST_LENGTH = 1e-3
#: adaptive steps (step doubling): length of the first substep of a scene over its first step [press]
PATH_FIRST = 1.0 / 16.0
#: adaptive steps: largest ratio of the lengths of successive substeps, up or down
PATH_CHANGE = 4.0
#: adaptive steps: safety factor of the next length
PATH_SAFETY = 0.9
#: a substep that fails at this fraction of the step is followed by the first release [snaps]
RELEASED = 1.0 / 32.0
#: after a release the next one within the same step follows a failed substep longer by this factor [texture]
COARSER = 4.0
#: factor by which the rate of drag of a released body falls, and rises [snaps]
DRAG_CHANGE = 2.0
#: where its speed grows less or more than these factors in one step
DRAG_GROWTH = (1.25, 2.0)
#: drag of a rate below this is nearly none: a body that slows down may be at rest [snaps]
DRAG_REST = 0.01
#: what was not at rest is asked again at so much less drag
DRAG_CALMER = 0.1
#: smallest rate of drag; a body that rests only with it ends the release [snaps]
DRAG_LEAST = 1e-9
#: largest rate of drag; a step that fails with it is no snap
DRAG_MOST = 1e6
#: a release begins so far aside, mm: far above what iterations leave, far below what is seen [crests]
IMPERFECTION = 1e-5
#: steps of a release, failed ones included, before it is given up [snaps]
DRAG_STEPS = 400
#: a step that failed where what takes stability away grows so fast, relative to what holds it, has no
#: equilibrium near; the second, where the body softened in its iterations [snaps]
CRITICAL, SOFTENED = 0.9, 0.5
#: so many of the largest out-of-balance forces are named in a failure
NAMED = 3
