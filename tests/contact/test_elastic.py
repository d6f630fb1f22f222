"""Compliances of elastic layers: point loads, limits, and that they are those of a linear elastic body."""

import numpy as np
import pytest

import evfem as ev
from evfem.surface.elastic import transfer
from evfem.surface.patches import love
from evfem.terms import foundation
from evfem.terms.foundation import slopes

#: u_z E*/P, u_x E*/Q, u_z mu/Q at x/H, by quadrature of the inverse transform to 10 digits
POINT_LOADS = {
    0.48: {
        0.25: (0.3466233634, 1.3198680378, -0.0152213913),
        0.5: (0.0090662310, 0.9171833599, -0.0352840248),
        1.0: (-0.1268455189, 0.5803676135, -0.0514322000),
    },
    0.3: {
        0.25: (0.5751694162, 1.1621555909, 0.0647179472),
        0.5: (0.2109414236, 0.7560535797, 0.0344974209),
        1.0: (0.0033346229, 0.4189356387, -0.0014188533),
        2.0: (-0.0097406223, 0.1727123742, -0.0094425959),
    },
}


@pytest.mark.parametrize("nu", POINT_LOADS)
def test_point_loads_on_a_layer(nu):
    E, H = 0.37, 2.0
    layer, modulus, mu = ev.ElasticLayer(E, nu, H), E / (1.0 - nu**2), 0.5 * E / (1.0 + nu)
    for place, expected in POINT_LOADS[nu].items():
        found = layer.compliance([0.0, place * H], [1e-6, 1e-6])
        numbers = found[1, 0] * modulus, found[3, 2] * modulus, found[1, 2] * mu
        np.testing.assert_allclose(numbers, expected, atol=2e-10)


def test_the_compliance_of_a_coated_layer_over_the_wavenumber():
    """Coating E 1.0, nu 0.3, 0.2 thick on a half-plane of E 0.08, nu 0.48: Mn, Mt, N of the coating."""
    stack, mu, nu = (ev.ElasticLayer(1.0, 0.3, 0.2), ev.ElasticLayer(0.08, 0.48, 500.0)), 1.0 / 2.6, 0.3
    k = np.array([0.1, 0.5, 1.0]) / 0.2
    normal, tangent, cross = transfer(stack, k)
    np.testing.assert_allclose(
        normal * mu * k / (1 - nu), [10.5188941044, 8.3965660153, 4.1954567260], rtol=1e-9
    )
    np.testing.assert_allclose(
        tangent * mu * k / (1 - nu), [3.5133092488, 1.6639539980, 1.5815872923], rtol=1e-9
    )
    np.testing.assert_allclose(2.0 * cross * mu * k, [0.9440368276, 2.7667253209, 2.2317101973], rtol=1e-9)


def test_a_thick_layer_is_a_half_plane_near_by():
    """Means of -ln over strips of length 1: own 1.5, others by the closed form."""
    E, nu = 1.0, 0.3
    found = ev.ElasticLayer(E, nu, 1e3).compliance([0.0, 1.0, 2.0, 10.0], np.ones(4))[0, :4]
    means = np.array([1.5, 0.1137056389, -0.6711665768, -2.301750087])
    np.testing.assert_allclose((found - found[0]) * 0.5 * np.pi * E / (1 - nu**2), means - 1.5, atol=1e-4)


def test_a_thin_layer_is_a_bed_of_springs_and_shears():
    """Strips much longer than it is thick: H / (lambda + 2 mu) and H / mu per length."""
    E, nu, H, long = 1.0, 0.3, 1e-3, 1.0
    own = ev.ElasticLayer(E, nu, H).compliance([0.0], [long])
    mu = 0.5 * E / (1.0 + nu)
    assert own[0, 0] == pytest.approx(H / long * (1.0 - 2.0 * nu) / (2.0 * mu * (1.0 - nu)), rel=2e-3)
    assert own[1, 1] == pytest.approx(H / long / mu, rel=2e-3)


@pytest.mark.parametrize("nu", [0.0, 0.3, 0.5])
@pytest.mark.parametrize("thickness", [0.02, 0.5, 20.0])
def test_the_compliance_is_symmetric_and_positive(nu, thickness):
    """Strips side by side, of lengths from 0.02 to 0.2 mm, without and with gaps."""
    lengths = np.random.default_rng(1).uniform(0.02, 0.2, 40)
    x = np.cumsum(lengths) - 0.5 * lengths
    for places in (x, 1.5 * x):
        found = ev.ElasticLayer(0.2, nu, thickness).compliance(places, lengths)
        np.testing.assert_array_equal(found, found.T)
        assert np.linalg.eigvalsh(found).min() > 0.0


def test_the_slope_of_the_compliance_is_its_derivative():
    class Own:
        def compliance(self, x, lengths):
            return ev.ElasticLayer(0.2, 0.4, 1.0).compliance(x, lengths)

    x, lengths = np.array([-0.3, 0.02, 0.4, 1.7]), np.array([0.1, 0.2, 0.15, 0.1])
    exact = ev.ElasticLayer(0.2, 0.4, 1.0).compliance_slope(x, lengths)
    np.testing.assert_allclose(slopes(Own(), x, lengths), exact, atol=1e-4 * np.abs(exact).max())


def under_cylinder(layers, half_width, radius=10.0, count=200):
    """Load, depth and pressure in the middle of a rigid cylinder on layers whose compliances add up: strips
    between the zeros of Chebyshev's polynomials, and the depth at which no pressure is infinite at the edge.
    """
    angle = np.linspace(0.0, np.pi, count + 1)
    ends = -half_width * np.cos(angle)
    x, lengths = 0.5 * (ends[1:] + ends[:-1]), np.diff(ends)
    given = sum(layer.compliance(x, lengths)[:count, :count] for layer in layers)
    profile = (ends[1:] ** 3 - ends[:-1] ** 3) / (6.0 * radius * lengths)
    force = np.linalg.solve(given, np.column_stack([np.ones(count), -profile]))
    middle = 0.5 * (angle[1:] + angle[:-1])
    edge = np.polynomial.polynomial.polyfit(
        middle[:8] ** 2, (force / lengths[:, None] * np.sin(middle)[:, None])[:8], 2
    )[0]
    depth = -edge[1] / edge[0]
    whole = force @ [depth, 1.0]
    return whole.sum(), depth, whole[count // 2] / lengths[count // 2]


TISSUE, COATED = ev.ElasticLayer(0.08, 0.48, 2.0), (1.0, 0.3, 0.2)


@pytest.mark.parametrize(
    ("below", "half_width", "expected"),
    [
        ((0.2, 0.48, 2.0), 1.0, (0.0071945671, 0.0646704486, 0.0046150785)),
        ((0.2, 0.48, 2.0), 2.0, (0.0428627875, 0.1928340957, 0.0143154347)),
        ((0.2, 0.48, 1.0), 1.0, (0.0079301552,)),
        ((0.2, 0.48, 1.0), 2.0, (0.0497010367,)),
    ],
)
def test_two_layers_of_unlike_thickness_under_a_cylinder(below, half_width, expected):
    """Load, depth, largest pressure of R = 10; a finger's layer against a surface's, without friction."""
    found = under_cylinder([TISSUE, ev.ElasticLayer(*below)], half_width)
    for one, wanted, off in zip(found, expected, (1e-6, 1e-6, 5e-5), strict=False):
        assert one == pytest.approx(wanted, rel=off)


@pytest.mark.slow
def test_a_coated_half_plane_under_a_cylinder():
    """What a finite depth H adds to the load falls with 1/H^2."""
    loads = []
    for depth in (12.5, 25.0):
        stack = ev.ElasticStack([ev.ElasticLayer(*COATED), ev.ElasticLayer(0.08, 0.48, depth)])
        loads.append(under_cylinder([stack], 1.0)[0])
    assert (4.0 * loads[1] - loads[0]) / 3.0 == pytest.approx(0.0111773257, rel=5e-6)


def grid(count, distance, seed=3):
    """Places (n, 2) about `distance` apart, and areas of squares that leave gaps or overlap a little."""
    random = np.random.default_rng(seed)
    even = distance * np.stack(np.meshgrid(np.arange(count), np.arange(count)), axis=-1).reshape(-1, 2)
    return even + random.uniform(-0.2, 0.2, even.shape) * distance, random.uniform(
        0.5, 1.2, len(even)
    ) * distance**2


@pytest.mark.parametrize(
    ("x", "sizes"), [(np.linspace(-1.0, 1.0, 7), np.full(7, 0.3)), grid(4, 0.7)], ids=["plane", "space"]
)
def test_layers_of_one_material_are_one_layer(x, sizes):
    one = ev.ElasticLayer(0.2, 0.48, 2.0).compliance(x, sizes)
    parts = [ev.ElasticLayer(0.2, 0.48, 0.5), ev.ElasticLayer(0.2, 0.48, 1.5)]
    np.testing.assert_allclose(ev.ElasticStack(parts).compliance(x, sizes), one, atol=1e-9 * one.max())


def test_a_square_on_a_half_space():
    """Its own mean p L (1 - nu^2)/E x .9464020088; a layer 1e4 times as thick is 1.2 L / H less."""
    middle, corner = (love(np.array([[at, at]]), np.ones(1), np.full(1, 1e-3))[0, 0] for at in (0.0, 0.5))
    np.testing.assert_allclose([middle / np.pi, corner / np.pi], [1.1221997047, 0.5610998523], rtol=1e-3)
    E, nu = 0.37, 0.3
    own = ev.ElasticLayer(E, nu, 1e3).compliance(np.zeros((1, 2)), [0.01])
    assert own[0, 0] * 0.1 * E / (1.0 - nu**2) == pytest.approx(0.9464020088, rel=2e-4)
    far = ev.ElasticLayer(E, nu, 1e3).compliance([[0.0, 0.0], [3.0, 0.0]], [0.01, 0.01])
    # Cerruti and Boussinesq: u_x of q_x and u_z of q_z at a distance along x, u_z of q_x
    mu = 0.5 * E / (1.0 + nu)
    point = np.array([1.0, 1.0 - nu, 0.5 - nu]) / (2.0 * np.pi * mu * 3.0)
    found = [far[3, 2], far[5, 4], far[1, 2]]
    np.testing.assert_allclose(found, point, rtol=0.01)


@pytest.mark.parametrize("x", [0.0, 0.2, 1.0, 2.5])
def test_squares_in_a_row_are_a_strip(x):
    """Forces on squares along z act on one of them as the strip of plane strain does."""
    layer, count = ev.ElasticLayer(0.2, 0.3, 2.0), 401
    places = np.column_stack([np.full(count, x), 0.2 * (np.arange(count) - count // 2)])
    found = layer.compliance(np.vstack([places, [[0.0, 0.0]]]), np.full(count + 1, 0.04))
    rows = found.reshape(3, count + 1, 3, count + 1)[:2, -1, :2, :-1].sum(axis=2)
    strips = layer.compliance([0.0, x] if x else [0.0], [0.2]).reshape(2, -1, 2, 2 if x else 1)[:, 0, :, -1]
    np.testing.assert_allclose(0.2 * rows, strips, atol=2e-5 * abs(strips).max())


@pytest.mark.parametrize("thickness", [0.3, 2.0, 50.0])
@pytest.mark.parametrize("nu", [0.0, 0.5])
def test_the_compliance_in_space_is_symmetric_positive_and_has_that_slope(thickness, nu, monkeypatch):
    layer, (x, areas) = ev.ElasticLayer(0.2, nu, thickness), grid(7, 0.3)
    found, slope = layer.compliance(x, areas), layer.compliance_slope(x, areas)
    np.testing.assert_allclose(found, found.T, atol=1e-15 * found.max())
    assert np.linalg.eigvalsh(found).min() > 0.0

    class Own:
        def compliance(self, x, lengths):
            return layer.compliance(x, lengths)

    differenced = []
    for step in (1e-4, 2e-4):
        monkeypatch.setattr(foundation, "STEP", step)
        differenced.append(slopes(Own(), x, areas))
    missed = np.abs((4.0 * differenced[0] - differenced[1]) / 3.0 - slope).max(axis=0) / np.abs(slope).max()
    own = np.tile(np.eye(len(x), dtype=bool), (3, 3))  # a square's own has a kink there
    assert missed[own].max() < 1e-3
    assert missed[~own].max() < 1e-6


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: ev.ElasticLayer(-1.0, 0.3, 1.0), r"surface\.elastic\.E"),
        (lambda: ev.ElasticLayer(1.0, 0.6, 1.0), r"surface\.elastic\.nu"),
        (lambda: ev.ElasticStack([]), "1 to 20"),
        (lambda: ev.Flat(elastic=1.0), "ElasticLayer, ElasticStack, or an object"),
        (lambda: ev.Flat(elastic=ev.ElasticLayer), "ElasticLayer, ElasticStack, or an object"),
        (lambda: ev.ElasticLayer(1.0, 0.3, 1.0).compliance([0.0], [0.0]), "a length in mm above 0"),
    ],
)
def test_what_no_surface_can_be_is_refused(make, message):
    with pytest.raises(ev.InputError, match=message):
        make()


def test_a_soft_wave_is_pressed_without_friction_in_few_iterations():
    """The surface tilts under the forces that turn with it: a step that leaves this out fails, and ends in
    releases, of which 40 s see no end.
    """
    wave = ev.Sinusoid(friction=0.0, elastic=ev.ElasticLayer(E=0.2, nu=0.48, thickness=2.0))
    pad = ev.FingerPad(resolution="coarse")
    kept = ev.Solver(strategy=ev.Strategy(patience=0.0))  # a new tangent in every iteration
    result = ev.simulate(ev.Scene(pad, wave, motion=[ev.Press(force=0.02, steps=4)], solver=kept))
    assert result["substeps"].max() == 1
    assert result["newton_iterations"].sum() <= 40
    assert result["normal_force"][-1] == pytest.approx(0.02, rel=1e-7)


def test_a_fingertip_on_a_soft_display_takes_few_iterations():
    """Its slopes are no differences, whose rounding kept the residual above 2e-8, and nodes that turn up or
    leave the loaded zone stay in it to the step's end: they came and went for hundreds of iterations.
    """
    tip = ev.Fingertip(resolution="coarse", ridges="none")
    soft = ev.Display(friction=0.3, elastic=ev.ElasticLayer(0.2, 0.48, 2.0))
    attracted = {"law": ev.Kaczmarek(), "voltage": 1000.0, "breakdown": "off"}
    whole = ev.Solver(strategy=ev.Strategy(relaxation=False, smallest_part=0.9))
    scene = ev.Scene(tip, soft, motion=[ev.Press(force=0.2, steps=2)], solver=whole, **attracted)
    result = ev.simulate(scene)
    assert result["newton_iterations"].max() <= 12


def test_a_pad_that_slides_steadily_on_a_soft_surface_climbs_no_barrier():
    """In steady sliding the work of the bone is that of friction along the stretched surface: counted along
    the undeformed one, 0.8 % apart here, every step is divided into ten.
    """
    soft = ev.Display(friction=0.76, elastic=ev.ElasticLayer(E=0.42, nu=0.27, thickness=4.4))
    motion = [ev.Press(indentation=0.036, steps=2), ev.Slide(distance=-0.5, steps=5)]
    attracted = {"law": ev.Kaczmarek(), "voltage": 2400.0, "breakdown": "warn"}
    result = ev.simulate(ev.Scene(ev.FingerPad(resolution="coarse"), soft, motion=motion, **attracted))
    assert result["substeps"].max() == 1
    assert result.provenance["solver"]["barriers"] == 0
