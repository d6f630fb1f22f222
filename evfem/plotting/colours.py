"""Colours that are told apart with any colour vision, and maps that stay in order without colour.

Lines have the colours of Okabe and Ito (2008), fields viridis; a stress or strain with a sign has
a map from purple over white to orange, with white at zero (ColorBrewer, safe for colour-blind
readers).
"""

from __future__ import annotations

BLACK, ORANGE, SKY, GREEN, BLUE, VERMILION, PURPLE, YELLOW = (
    "#000000",
    "#E69F00",
    "#56B4E9",
    "#009E73",
    "#0072B2",
    "#D55E00",
    "#CC79A7",
    "#F0E442",
)
#: one after the other, for curves that have no colour of their own, with styles that differ in print
CURVES = (BLUE, VERMILION, GREEN, ORANGE, PURPLE, SKY, BLACK)
STYLES = ("-", "--", "-.", ":")
REGIONS = (SKY, ORANGE, BLUE, GREEN, VERMILION, PURPLE, YELLOW)
#: contact statuses 0, 1, 2
STATUS = {"open": "#B8B8B8", "stick": BLUE, "slip": VERMILION}
ONE_SIGN, BOTH_SIGNS = "viridis", "PuOr_r"
#: what is not coloured by a field: tissue, surface, lines between regions
TISSUE, GROUND, EDGE = "#EFEBE7", "#D0D0D0", "0.25"
