"""How much of what a pantograph feels is an echo from the ends of the model? Clamped against absorbing ends.

A model of an endless line has to end somewhere. The same pantograph rides at the same speed over a short piece of
line whose ends are clamped, or absorb what arrives, and over so long a piece that nothing comes back in time.
Whatever differs from the long one is no property of the line. The clamps run along with the train: they do work on
the wire that passes through them, and what they send back from ahead is shorter and steeper each time. So the echo
does not fade, it grows.
"""

import argparse
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from catenary_model.boundary import BOUNDARIES
from catenary_model.line_file import load_line
from catenary_model.model import Catenary, Config
from catenary_model.pantograph import Pantograph
from catenary_model.ride import Ride, ride

EN50318 = Pantograph.of([15.0, 7.2], [[100.0, -10.0], [-10.0, 10.0]], [[4250.0, -4200.0], [-4200.0, 4200.0]], 120.0)
START = 2.0  # s, in which the uplift comes up
LONG = 20  # spans


def main() -> None:
    """Draw the picture and print the figures that it shows."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path(), metavar="DIR", help="folder of the picture (here)")
    parser.add_argument("--line", default="en50318_2002", help="preset or YAML file (en50318_2002)")
    parser.add_argument("--speed-kmh", type=float, default=250.0, help="km/h (250)")
    parser.add_argument("--duration", type=float, default=6.0, help="s (6)")
    parser.add_argument("--kinds", nargs="+", default=["clamped", "matched_dashpot"], choices=BOUNDARIES)
    given = parser.parse_args()

    def go(boundary: str, **domain: float) -> Ride:
        try:
            config = Config(line=load_line(given.line), speed=given.speed_kmh / 3.6, boundary=boundary, **domain)
            return ride(Catenary(config), EN50318, given.duration, START)
        except ValueError as error:
            parser.error(str(error))

    fig, axes = plt.subplots(2, 1, figsize=(10, 7), sharex=True)
    endless = go("matched_dashpot", spans=LONG)
    axes[0].plot(endless.t, endless.F, color="black", linewidth=2, label=f"{LONG} spans")
    after = endless.t > START
    for kind in given.kinds:
        short = go(kind, spans=2, layer_behind=0.0, layer_ahead=0.0)
        echo = short.F - endless.F
        share = np.sqrt(np.mean(echo[after] ** 2)) / endless.F[after].std()
        axes[0].plot(short.t, short.F, linewidth=1, label=f"2 spans, {kind}")
        axes[1].plot(short.t, echo, linewidth=1, label=f"{kind}: {100 * share:.0f} %")
        print(f"2 spans, {kind}: error {100 * share:.1f} % of the standard deviation of the contact force")
    layers = go("matched_dashpot", spans=2)
    echo = layers.F - endless.F
    share = np.sqrt(np.mean(echo[after] ** 2)) / endless.F[after].std()
    axes[1].plot(layers.t, echo, linewidth=1, label=f"matched_dashpot behind layers: {100 * share:.0f} %")
    print(f"2 spans and layers, matched_dashpot: error {100 * share:.1f} %")
    axes[0].set(
        ylim=(0.0, 2.2 * endless.F.max()),
        ylabel="contact force in N",
        title=f"{given.line} at {given.speed_kmh:g} km/h",
    )
    most = endless.F.max()
    axes[1].set(ylim=(-most, most), xlabel="time in s", ylabel="difference from the long line in N")
    for axis in axes:
        axis.legend(loc="upper left")
    fig.tight_layout()
    given.out.mkdir(parents=True, exist_ok=True)
    fig.savefig(given.out / "clamped_against_absorbed.png", dpi=130)


if __name__ == "__main__":
    main()
