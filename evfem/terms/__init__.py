"""Capabilities as rooms: what pulls on the pad, what is below it, what drives the bone, bounds of friction.

For a capability of one's own (docs, Add a capability): bases of tractions on the pad (`PadTraction`), terms
of the body (`BodyTerm`), elastic surfaces that remember (`Foundation`) and drives of the bone (`Hand`).
"""

from evfem.common.rooms import BodyTerm as BodyTerm
from evfem.common.rooms import Column as Column
from evfem.common.rooms import Foundation as Foundation
from evfem.common.rooms import Room as Room
from evfem.terms.hand import Hand as Hand
from evfem.terms.hand import HandControl as HandControl
from evfem.terms.traction import Entries as Entries
from evfem.terms.traction import PadState as PadState
from evfem.terms.traction import PadTraction as PadTraction
