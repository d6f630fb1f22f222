"""The picture of the README: its ten lines, drawn."""

from pathlib import Path

import evfem as ev
from evfem import plotting

PICTURE = Path(__file__).with_name("slide.png")


def main(path: Path = PICTURE) -> None:
    """Run the README's example and draw forces, pad and contact pressure."""
    from matplotlib.figure import Figure

    finger = ev.FingerPad()
    display = ev.Display(insulator=ev.Layer(thickness=0.09, eps_r=3.35), friction=0.3)
    motion = [ev.Press(force=0.05), ev.Slide(distance=2.0, steps=40)]
    scene = ev.Scene(
        finger, display, law=ev.Kaczmarek(), voltage=1000.0, motion=motion, output=ev.Output(every=50)
    )
    result = ev.simulate(scene)
    figure = Figure(figsize=(13.0, 4.2), layout="constrained")
    left, middle, right = figure.subplots(1, 3, width_ratios=[1.0, 1.45, 1.1])
    plotting.forces(result, ax=left)
    plotting.deformed(result, ax=middle)
    plotting.contact_pressure(result, ax=right)
    figure.savefig(path, dpi=90)


if __name__ == "__main__":
    main()
