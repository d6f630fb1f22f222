"""What depends on time: friction under a modulated voltage, and the modes of a fingertip."""

from dataclasses import replace

import numpy as np

import evfem as ev
from evfem.common.arrays import Floats
from evfem.response.impedance import linearised
from evfem.simulation.run import Run

from .table import Experiment, Row, spread, together
from .touching import others

SPEED, MESHES = 20.0, ("coarse", "medium", "paper")  # mm/s
FRICTION, ROUGH, VOLT, LOAD = 0.5, 3e-3, 75.0, 0.05  # N/mm
PERIODS, STEPS = 2, 16  # the last period counts; steps of a period
DEPTH, DEEP = 0.1, 0.5  # modulation of the attraction; the second for the error
HIGHEST, MANY = 250.0, 16  # Hz; so many modes are looked for
STIFFER = 1.1  # moduli: their root moves the frequencies


def gain(mesh: str, depth: float = DEPTH) -> float:
    """Amplitude of friction over the coefficient times that of the attraction, at the measured cut-off;
    `depth` is how much the attraction changes, relative to its mean.
    """
    frequency = others("cutoff_per_speed")["measured"] * SPEED
    finger = ev.FingerPad(ridges=False, resolution=mesh, viscosity=1e-3)
    display = ev.Display(ev.TOUCHSCREEN, friction=FRICTION)
    motion = [ev.Press(force=LOAD, steps=2), ev.Slide(2.0, steps=2, speed=SPEED, hold="force")]
    more = {"solver": ev.Solver(dynamics="viscous"), "roughness_gap": ROUGH}
    loop = ev.loop(ev.Scene(finger, display, ev.StrongTroxel(), VOLT, motion, **more))
    time = np.arange(1, PERIODS * STEPS + 1) / (STEPS * frequency)
    phase = np.exp(-2j * np.pi * frequency * time[-STEPS:])
    rows = []
    for t in time:
        volt = VOLT * np.sqrt(1.0 + depth * np.sin(2.0 * np.pi * frequency * t))
        duration = 1.0 / (STEPS * frequency)
        rows.append(loop.step(position=2.0 + SPEED * t, voltage=volt, duration=duration))
    friction, pull = (
        np.array([getattr(row, name) for row in rows[-STEPS:]])
        for name in ("applied_tangential_force", "electrostatic_force")
    )
    return float(abs(phase @ friction) / (FRICTION * abs(phase @ pull)))


def modulated(quick: bool) -> Experiment:
    """Gain of friction where the measured one is that of a first order response at its cut-off."""
    gains = [gain(mesh) for mesh in (MESHES[:1] if quick else MESHES)]
    error = together(spread(gains), np.log(gain(MESHES[0], DEEP) / gains[0]))
    row = Row("modulated_friction.276Hz", "gain of friction at 276 Hz and 20 mm/s", "1", gains[-1],
              error, **others("gain_at_cutoff"))  # fmt: skip
    return replace(BALASUBRAMANIAN, rows=(row,))


def frequencies() -> Floats:
    """The lowest frequencies (Hz) of a free fingertip with nail whose bone is held."""
    from scipy.sparse.linalg import LinearOperator, eigsh, splu

    finger = ev.Fingertip(resolution="coarse", ridges="none", rim="nail")
    run = Run(ev.Scene(finger, ev.Flat(friction=0.0), motion=[ev.Hover(gap=1.0)]), None)
    for request in run.requests():
        run.advance(request)
    system = linearised(run.model, run.state)
    free = system.still.shape[0] - 3
    stiffness, mass = (one.tocsc()[:free, :free] for one in (system.still, system.mass))
    factors = splu(stiffness, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
    solve = LinearOperator(stiffness.shape, factors.solve)
    squares = eigsh(stiffness, MANY, mass, sigma=0.0, return_eigenvectors=False, OPinv=solve)
    return np.sort(np.sqrt(squares) / (2.0 * np.pi))


def modes() -> Experiment:
    """How many modes a fingertip has up to 250 Hz."""
    found = frequencies()
    softer, own, stiffer = (
        int(np.sum(found * factor < HIGHEST)) for factor in (STIFFER**-0.5, 1.0, STIFFER**0.5)
    )
    row = Row("modes_below_250Hz", "modes of a fingertip up to 250 Hz", "1", float(own),
              0.5 * (softer - stiffer) / own, **others("modes"))  # fmt: skip
    return replace(SERHAT, rows=(row,))


BALASUBRAMANIAN = Experiment(
    title="Friction under a modulated voltage",
    source="Balasubramanian, Pool and Vardar (2025)",
    doi="10.48550/arXiv.2505.11162",
    read="the abstract",
    conditions="Ten people, 20 to 100 mm/s, 0.2 to 0.6 N; friction follows the voltage as a first order "
    "response whose cut-off rises by 13.8 Hz per mm/s.",
    assumed="That the line passes through the origin; plane strain, 0.05 N/mm, friction 0.5, 75 V, faces "
    "3 um apart, relaxation time 1 ms, an attraction that changes by a tenth; by half in the error.",
    fitted="nothing.",
    reason="While all of the contact slips, Coulomb's friction follows the attraction at once. A large "
    "change lets the skin stick for a part of the period, and friction then builds up over a way, as "
    "measured.",
    sceptic="A length over which slip renews friction (`ev.SlipMemory`) repairs this with one number.",
    answer="That number, 11.5 um, is taken from the same slope, so that no row is made of it. What it "
    "does predict is a cut-off over speed that is the same at all speeds; the pad's own elasticity would "
    "make it fall with the depth of the modulation, which tells the two apart.",
)
SERHAT = Experiment(
    title="Modes of a fingertip",
    source="Serhat and Kuchenbecker (2021)",
    doi="10.3390/app11125709",
    read="the abstract",
    conditions="A model, no measurement: finite elements of a fingertip from anatomy, seven modes up to "
    "about 250 Hz.",
    assumed="Table 2's pad with nail, the bone held, density of water; coarse mesh, 10 % of all moduli in "
    "the error.",
    fitted="nothing.",
    reason="Three of the modes lie just below 250 Hz; a count is sensitive to a few per cent there.",
    sceptic="Two models that agree may both be wrong.",
    answer="Yes. Both take bodies of similar size from soft tissue of some tens of kPa; more is not said.",
)
