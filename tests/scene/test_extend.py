"""A force law more: one class, and every door of the package knows it."""

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
import pytest
from tools.refusals import refuses
from tools.scenes import HOVER, head

import evfem as ev
from evfem.common.checks import Within, number, to_python
from evfem.electrostatics.laws import FORCE_LAWS, GapPermittivity, NamedLaw
from evfem.errors import InputError
from evfem.scene.file import dump, loads
from evfem.scene.schema import schema

KEYS = 'law = "softened"\nsoftening = 0.02\ngap_eps_r = 2.0\ninsulator = "film"\nvoltage = 100.0'
TEXT = head(KEYS) + HOVER


@pytest.fixture
def softened():
    @dataclass(frozen=True)
    class Softened(NamedLaw, name="softened"):
        softening: Annotated[float, number("a length in mm, not negative", Within(0.0), "mm"), "of the gap"]
        gap_eps_r: GapPermittivity = 1.0

        def traction(self, gap, voltage, layers):
            far = np.asarray(gap) + self.softening + self.gap_eps_r * layers.reduced
            return to_python(0.5 * self.gap_eps_r * ev.electrostatics.eps_0 * (voltage / far) ** 2)

    yield Softened
    del FORCE_LAWS["softened"]


def test_a_law_more_is_a_class(softened):
    scene = loads(TEXT)
    assert scene.law == softened(0.02, 2.0)
    assert loads(dump(scene)) == scene
    found = schema()["properties"]["electrostatics"]["properties"]
    assert found["softening"]["description"] == "of the gap (mm). Allowed: a length in mm, not negative"
    with pytest.raises(InputError, match=r"electrostatics\.softening: given -1; allowed: a length in mm"):
        loads(TEXT.replace("0.02", "-1"))
    refuses(r"electrostatics\.softening: missing", loads, TEXT.replace("softening = 0.02", ""))
    refuses(r"electrostatics\.softening: given an unknown key", loads, TEXT.replace("softened", "kaczmarek"))
    with pytest.raises(InputError, match=r"electrostatics\.field: given full with"):
        loads(TEXT.replace("voltage =", 'field = "full"\nvoltage ='))
    assert ev.simulate(scene).normal_force[-1] == pytest.approx(0.0, abs=1e-12)


def test_a_law_that_derives_from_another_is_for_python_alone():
    class Weaker(ev.StrongTroxel):
        def traction(self, gap, voltage, layers):
            return 0.5 * super().traction(gap, voltage, layers)

    scene = replace(ev.default_scene(), law=Weaker())
    assert Weaker not in FORCE_LAWS.values()
    refuses(r"electrostatics\.law: given Weaker", dump, scene)
    refuses("full with Weaker; allowed: local, or StrongTroxel", replace, scene, field="full")
    assert replace(scene, law=ev.StrongTroxel(), field="full").field == "full"
