"""Tables become what they describe, here the laws of materials."""

import pytest

from evfem.errors import InputError
from evfem.scene.keys import read_kind
from evfem.tissue.laws import LAWS, LinearElastic, NeoHookean, Ogden, Yeoh


def material(table, place="material"):
    return read_kind(table, place, LAWS, tag="law")


def test_tables_make_every_law():
    assert material({"law": "neo_hookean", "E": 0.05, "nu": 0.48}) == NeoHookean(E=0.05, nu=0.48)
    assert material({"law": "linear_elastic", "E": 1, "nu": 0.2, "density": 2e-9}) == LinearElastic(
        1, 0.2, density=2e-9
    )
    assert material({"law": "yeoh", "c1": 0.5, "c3": 0.1, "bulk": 3.0}) == Yeoh(c1=0.5, c3=0.1, bulk=3.0)
    ogden = material({"law": "ogden", "mu": [1.0, -0.2], "alpha": [2.0, -2.0], "nu": 0.45, "viscosity": 1e-3})
    assert ogden == Ogden(mu=(1.0, -0.2), alpha=(2.0, -2.0), nu=0.45, viscosity=1e-3)
    assert set(LAWS) == {"neo_hookean", "yeoh", "ogden", "linear_elastic"}


@pytest.mark.parametrize(
    ("table", "key", "words"),
    [
        ({"E": 1.0, "nu": 0.3}, "skin.law", "neo_hookean"),
        ({"law": "mooney"}, "skin.law", "ogden"),
        ({"law": "neo_hookean", "E": 1.0, "nu": 0.3, "G": 2.0}, "skin.G", "law, E, nu, viscosity, density"),
        ({"law": "neo_hookean", "E": 1.0}, "skin.nu", "missing"),
        ({"law": "neo_hookean", "E": 1.0, "nu": 0.7}, "skin.nu", "below 0.5"),
        (
            {"law": "ogden", "mu": 1.0, "alpha": 2.0, "nu": 0.3, "volume_measure": "trace"},
            "skin.volume_measure",
            "mu, alpha",
        ),
    ],
)
def test_wrong_tables_are_refused_by_key(table, key, words):
    with pytest.raises(InputError, match=words) as caught:
        material(table, "skin")
    assert caught.value.key == key
