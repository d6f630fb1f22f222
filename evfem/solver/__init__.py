r"""Equilibrium steps of a body in contact: the algorithm from the outside in, on one page.

**Problem.** A body with nodal displacements u, its bone translated by b, touches a rigid profile.
A step goes from an accepted state to a target: a position of the bone or a force on it, a voltage or a
friction force (`evfem.newton.control`). With the gap g of a pad node, its slip s since the accepted
state, and contact forces :math:`\lambda` along the profile's normal and tangent, the state sought obeys

.. math:: R = f_{int}(u) - f_{el}(u) - \lambda = 0, \qquad
          g \ge 0,\; \lambda_n \ge 0,\; g\lambda_n = 0, \qquad
          |\lambda_t| \le \mu\lambda_n,\; \lambda_t = -\mu\lambda_n\,s/|s| \text{ if } s \ne 0 .

With viscosity or inertia :math:`f_{int}` has their forces by backward differences
(`evfem.tissue.dynamics`); another law of friction replaces :math:`\mu\lambda_n`. A step that fails leaves
the accepted state as it was.

**Which of several states.** Under a strong attraction several states obey these laws. The answer is
the limit of vanishing drag [5]_ [6]_: with a drag of rate :math:`\epsilon`

.. math:: \epsilon\,\dot u + R(u, \lambda;\, t) = 0, \qquad \epsilon \to 0 ,

the body follows the branch of stable states that begins at the last one. Where that branch ends it snaps:
under the loads at that point it moves to the state that drag leads to, and rests there. All that follows
are algorithms to find that state; none decides which it is. A state that iterations found elsewhere is
refused where the potential with the loads of the end of the substep,

.. math:: \Phi(u) = \psi(u) - W_{el}(u) - W_{bone}(u) + D_{friction}(u) ,

rises on the straight path to it (`evfem.simulation.barrier`): the body would have to climb. That is
necessary, not sufficient: where several states lie downhill, the nearest branch is not told from others.

**1. A step is divided into substeps** (`stepping`; the user's numbers: `evfem.newton.strategy`)::

    length <- that of the last successful substep
    repeat until the step's end is reached
        find the equilibrium at the end of the substep (2)
        found behind a barrier: find it by drag continuation from the old state (`hold`)
        found: accept it; after few iterations the next substep is longer
        not found: halve the substep; from 1/32 of the step on, pseudo-transient continuation (5); where
            that does not come to rest, halve on, and fail at the smallest substep

With `steps = "auto"` the length follows the difference of one substep and two halves (`path`).

**2. One equilibrium** (`evfem.newton.equilibrium`)::

    u <- extrapolated along the increment of the last substep
    repeat
        R <- balance; its residual is the largest free force over the largest reaction
        residual <= tolerance: accept if the state passes (4)
        fail if the residual is not finite or stagnates, or after the strategy's iterations
        u, lambda <- the linear contact step (3)

**3. A linear contact step** (`evfem.newton.factorised`; 2 to 4 name its neighbours). The tangent K of the
tissue, often that of an earlier iterate, is condensed onto the nodes c that may touch and the bone
(`linearisation`, `condensation`; PARDISO, own Cholesky factors or SuperLU), and :math:`C = S_{cc}^{-1}`:

.. math:: S_{cc}\,\Delta u_c + S_{cb}\,\Delta b = g_c + \lambda^+ - \lambda + \Delta f_{el}, \qquad
          S_{bc}\,\Delta u_c + S_{bb}\,\Delta b = g_b + F_b .

Gaps and slips are then linear in the new forces :math:`\lambda^+`, and the laws of contact are
solved exactly by an active set, Newton's method on projections [1]_ [2]_
(`evfem.contact.condensed`). Unknown travel of the bone, and a voltage determined by a prescribed friction
force, charge or gap (`control`), are extra unknowns of the same problem::

    factorise K at u if there is no factorisation, it was made for other candidates or another time
        step, or more than `patience` iterations would be left with it
    lambda, statuses, travel <- contact on C; without a solution once more with K at u, then fail
    shorten the bone's travel where it is too long for a linear step (`travel`)
    u <- u + du; du is halved while a cell's volume ratio falls below 0.05
    u <- combination with the last iterates (`anderson`) [3]_

Nearly incompressible tissue has its pressure as an unknown beside u (`pressure`).

**4. Acceptance** (`equilibrium`, `interface`). No open node has penetrated, closed gaps, stick, the
directions of slip and the bounds of friction hold at the present positions, and the controls agree.
A state is refused whose outline crosses itself, or that is unstable because contact forces on crests
push slipping nodes aside harder than the tissue holds them (`evfem.contact.stability`).

**5. Pseudo-transient continuation** [4]_, called release (`relaxation`). Where a quasi-static path loses
stability, the body moves on under drag of a rate s in pseudo-time steps: each is an equilibrium (2) of

.. math:: R(u, \lambda) + f_{drag}(u - u_k;\, s) = 0 .

s falls while the body slows down, and rises after failures. The end is an equilibrium without drag.
What the drag dissipates is `snap_dissipation`.

**Safeguards.** What drawn scenes lose without each of them is on the page on verification (`tests/tools`
has what switches them off): the slope of friction in the compliance; turning contact forces (`follower`);
softening scaled below critical, and a gain between rough faces that is limited (`traction`); bracketed
friction (`terms.slipping`) and pins at its jumps (`interface.FrictionJumps`); release; barriers; the bone's
travel (`travel`); tangents that are kept (`linearisation`); combined iterates (`anderson`); the worst node
first; an extrapolated start; stagnation (`strategy.stuck`). Others only refuse: volume ratios below 0.05,
folds, unstable states.

Every constant is in `evfem.common.constants`; none decides what is accepted.

.. [1] P. Alart, A. Curnier, Comput. Methods Appl. Mech. Eng. 92 (1991) 353,
   doi:10.1016/0045-7825(91)90022-X.
.. [2] S. Hueeber, G. Stadler, B. Wohlmuth, SIAM J. Sci. Comput. 30 (2008) 572, doi:10.1137/060671061.
.. [3] D. G. Anderson, J. ACM 12 (1965) 547, doi:10.1145/321296.321305.
.. [4] C. T. Kelley, D. E. Keyes, SIAM J. Numer. Anal. 35 (1998) 508, doi:10.1137/S0036142996304796.
.. [5] M. A. Efendiev, A. Mielke, J. Convex Anal. 13 (2006) 151.
.. [6] L. Minotti, G. Savare, Arch. Ration. Mech. Anal. 227 (2018) 477, doi:10.1007/s00205-017-1165-5.
"""
