"""Capabilities as rooms: tractions on the pad, elastic foundations, drives of the bone, bounds of friction.

For user-defined capabilities (docs, Add a capability): bases of tractions on the pad (`PadTraction`), terms
of the body (`BodyTerm`), elastic surfaces with memory (`Foundation`) and drives of the bone (`Hand`).
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
