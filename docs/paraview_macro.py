"""ParaView macro: the deformed pad coloured by von Mises stress, and its outline by contact
pressure.

In ParaView 5.9 or newer: open `fields.pvd`, press Apply, then Macros > Import new macro... and
choose this file; from then on it is a button. From a terminal:
`pvpython paraview_macro.py fields.pvd pad.png`.
"""

import sys

from paraview import simple

STRESS, PRESSURE = ("CELLS", "von_mises"), ("POINTS", "contact_pressure")
#: colour maps and places of the two legends (in shares of the view)
MAPS = {STRESS: "Viridis (matplotlib)", PRESSURE: "Inferno (matplotlib)"}
PLACES = {STRESS: [0.03, 0.3], PRESSURE: [0.87, 0.3]}
TITLES = {STRESS: "von Mises stress (MPa)", PRESSURE: "contact pressure (MPa)"}


def coloured(source, view, field):
    """Show a source coloured by a field, with a legend and the range of the present step."""
    shown = simple.Show(source, view)
    simple.ColorBy(shown, field)
    shown.RescaleTransferFunctionToDataRange(False, True)
    colours = simple.GetColorTransferFunction(field[1])
    colours.ApplyPreset(MAPS[field], True)
    legend = simple.GetScalarBar(colours, view)
    legend.Title, legend.ComponentTitle = TITLES[field], ""
    legend.LabelFormat = legend.RangeLabelFormat = "%.3f"
    legend.WindowLocation, legend.Position, legend.ScalarBarLength = "Any Location", PLACES[field], 0.4
    shown.SetScalarBarVisibility(view, True)
    shown.Ambient, shown.Diffuse, shown.Specular = 1.0, 0.0, 0.0  # colours as in the legend, no light
    return shown


def show(series):
    """The picture of a series (fields.pvd) at its present time."""
    view = simple.GetActiveViewOrCreate("RenderView")
    view.InteractionMode, view.OrientationAxesVisibility = "2D", 0
    simple.LoadPalette("WhiteBackground")
    simple.Hide(series, view)
    deformed = simple.WarpByVector(registrationName="deformed", Input=series)
    deformed.Vectors = ["POINTS", "displacement"]
    coloured(deformed, view, STRESS)
    surface = simple.ExtractSurface(registrationName="surface", Input=deformed)
    outline = simple.FeatureEdges(registrationName="outline", Input=surface)
    outline.FeatureEdges, outline.ManifoldEdges, outline.NonManifoldEdges = 0, 0, 0
    coloured(outline, view, PRESSURE).LineWidth = 5.0
    simple.Render(view)  # the first picture would move the camera
    view.ResetCamera(True)
    view.CameraParallelScale *= 0.75
    simple.Render(view)
    return view


def main():
    """Show the series that is selected, or that a terminal names, at its last step."""
    files = sys.argv[1:]
    series = simple.PVDReader(FileName=files[0]) if files else simple.GetActiveSource()
    scene = simple.GetAnimationScene()
    scene.UpdateAnimationUsingDataTimeSteps()
    scene.GoToLast()
    if files:
        simple.GetActiveViewOrCreate("RenderView").ViewSize = [1400, 900]
    view = show(series)
    if len(files) > 1:
        simple.SaveScreenshot(files[1], view)


main()
