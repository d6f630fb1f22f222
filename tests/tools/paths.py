"""Random ways and voltage signals of one finger, and how far the fast model is from the full one
on them: what `docs/howto/fast.md` says of the stated error.

    python tests/tools/paths.py [--scenes 40] [--seed 1000]

Amplitude from 5 V to 1.25 kV, bias, wave length in steps, kind (sine, two sines, random walk,
ramps), load, friction, what is held, one way or to and fro, and where to first are drawn anew for
every scene. The full model of each is run too, a second or two.
"""

import argparse

import numpy as np

import evfem as ev

LARGEST = 2500.0  # V
LOAD, FRICTION = 0.05, 0.4
FORCES = ("normal_force", "tangential_force", "electrostatic_force")


def scene(finger, voltage, slides, friction=FRICTION, load=LOAD):
    """A press in five steps, then the slides."""
    display = ev.Display(insulator=ev.Layer(thickness=0.09, eps_r=3.35), friction=friction)
    motion = [ev.Press(force=load, steps=5), *slides]
    output = ev.Output(every=100_000)
    return ev.Scene(finger, display, law=ev.Kaczmarek(), voltage=voltage, motion=motion, output=output)


def trained(finger, way=1.8, steps=18):
    """The fast model made at the largest load, friction and voltage, both ways."""
    return ev.reduce(
        scene(finger, LARGEST, [ev.Slide(way, steps=steps), ev.Slide(-2.0 * way, steps=2 * steps)])
    )


def drawn(rng, places, step):
    """A signal between -1 and 1 at these places (mm), with `step` mm to a step of the slide."""
    kind = rng.choice(["sine", "two sines", "walk", "ramps"])
    if kind == "sine":
        return np.sin(2.0 * np.pi * (places / (step * rng.uniform(2.5, 60.0)) + rng.random()))
    if kind == "two sines":
        waves = [rng.uniform(2.5, 20.0), rng.uniform(5.0, 60.0)]
        return 0.5 * sum(np.sin(2.0 * np.pi * places / (step * wave)) for wave in waves)
    if kind == "walk":
        ends = np.cumsum(rng.normal(size=round(np.ptp(places) / step) + 1))
        ends = (ends - ends.mean()) / np.abs(ends - ends.mean()).max()
    else:
        ends = rng.uniform(-1.0, 1.0, rng.integers(2, 8))
    return np.interp(places, np.linspace(places[0], places[-1], ends.size), ends)


def random_scene(seed, finger, steps=60):
    """The scene of this seed: a press and `steps` of sliding under a random signal."""
    rng = np.random.default_rng(seed)
    hold, way = str(rng.choice(["force", "indentation"])), rng.choice([-1.0, 1.0]) * rng.uniform(0.9, 1.8)
    slides = [ev.Slide(way, steps=steps, hold=hold)]
    if rng.random() < 0.5:
        half = steps // 2
        slides = [ev.Slide(0.5 * way, steps=half, hold=hold), ev.Slide(-0.5 * way, steps=half, hold=hold)]
    amplitude = 10.0 ** rng.uniform(0.7, 3.1)
    bias = rng.uniform(amplitude, LARGEST - amplitude)
    places = np.linspace(*sorted((0.0, way)), 20 * steps + 1)
    volts = np.clip(bias + amplitude * drawn(rng, places, abs(way) / steps), 0.0, LARGEST)
    friction, load = float(rng.choice([0.2, 0.3, 0.4, 0.4])), float(rng.choice([0.035, LOAD, LOAD]))
    return scene(finger, ev.VoltageProfile(places, volts), slides, friction, load)


def errors(result, full):
    """Largest difference of every force to the full model's, as a share of its largest."""
    found = {}
    for name in FORCES:
        one, other = getattr(result, name), getattr(full, name)
        found[name] = float(np.abs(one - other).max() / np.abs(other).max())
    return found


def modulation(result, full, name, steps):
    """How far the last `steps` values of a force, their mean left out, are from the full model's,
    as a share of what the full model's vary from peak to peak.
    """
    one, other = (getattr(each, name)[-steps:] for each in (result, full))
    return float(np.abs((one - one.mean()) - (other - other.mean())).max() / np.ptp(other))


def main():
    """Print what is stated over what is true for every scene, and the distribution."""
    arguments = argparse.ArgumentParser()
    arguments.add_argument("--scenes", type=int, default=40)
    arguments.add_argument("--seed", type=int, default=1000)
    given = arguments.parse_args()
    finger = ev.FingerPad(resolution="coarse", ridges=False)
    fast, ratios, true = trained(finger), [], []
    print("scene, then true error and stated / true of " + ", ".join(FORCES))
    for seed in range(given.seed, given.seed + given.scenes):
        made = random_scene(seed, finger)
        result, full = fast.simulate(made, tolerance=1.0), ev.simulate(made)
        stated, found = result.provenance["fast"]["error"], errors(result, full)
        true.append(list(found.values()))
        ratios.append([stated[name] / found[name] for name in FORCES])
        parts = [f"{error:.1e} {ratio:5.2f}" for error, ratio in zip(true[-1], ratios[-1], strict=True)]
        print(f"{seed:6d}  " + "   ".join(parts), flush=True)
    for name, ratio, error in zip(FORCES, np.transpose(ratios), np.transpose(true), strict=True):
        low, median, high = np.quantile(ratio, [0.05, 0.5, 0.95])
        print(
            f"{name}: true error to {error.max():.1e}, median {np.median(error):.1e}; stated / true "
            f"{ratio.min():.2f} to {ratio.max():.2f}, 5 % {low:.2f}, median {median:.2f}, 95 % {high:.2f}"
        )


if __name__ == "__main__":
    main()
