"""What do spans of different length do to the contact force? Force along the track and its spectrum.

On even spans the pantograph meets the same stiffness and sag again and again: one frequency, v / L, and its
multiples. Where spans of two lengths take turns, the force repeats itself only every two spans, and the spectrum gets
the lines in between; the line of the droppers, which stand as far apart in either span, stays what it was.
"""

import argparse
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from catenary_model.line_file import load_line
from catenary_model.model import Catenary, Config
from catenary_model.pantograph import Pantograph
from catenary_model.ride import ride

EN50318 = Pantograph.of([15.0, 7.2], [[100.0, -10.0], [-10.0, 10.0]], [[4250.0, -4200.0], [-4200.0, 4200.0]], 120.0)
START = 4.0  # s, in which the uplift comes up and the first waves run off


def main() -> None:
    """Draw the picture and print the figures that it shows."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path(), metavar="DIR", help="folder of the picture (here)")
    parser.add_argument(
        "--line", nargs="+", default=["en50318_2002", "alternating_spans"], help="presets or YAML files"
    )
    parser.add_argument("--speed-kmh", type=float, default=200.0, help="km/h (200)")
    parser.add_argument("--periods", type=int, default=6, help="of the line, ridden over once all is under way (6)")
    given = parser.parse_args()
    try:
        lines = [load_line(name) for name in given.line]
    except ValueError as error:
        parser.error(str(error))
    v = given.speed_kmh / 3.6

    fig, axes = plt.subplots(2, len(lines), figsize=(6 * len(lines), 7), squeeze=False, sharey="row")
    for (above, below), line in zip(axes.T, lines, strict=True):
        catenary = Catenary(Config(line=line, speed=v))
        rode = ride(catenary, EN50318, START + given.periods * line.period / v, START)
        after = rode.t > START
        F, track = rode.F[after], rode.track[after] - np.floor(rode.track[after][0] / line.period) * line.period
        above.plot(track, F, linewidth=0.8)
        for mast in (*line.span_starts, line.period):
            above.axvline(line.period + mast, color="0.8", linewidth=3, zorder=0)
        above.set(title=line.name, xlim=(line.period, 3 * line.period), xlabel="track position in m (grey: masts)")
        amplitude = 2.0 * np.abs(np.fft.rfft((F - F.mean()) * np.hanning(F.size))) / np.hanning(F.size).sum()
        frequency = np.fft.rfftfreq(F.size, catenary.config.cycle_time)
        below.plot(frequency * line.period / v, amplitude)
        below.set(xlim=(0.0, 12.0 * len(line.spans)), xlabel="waves per period of the line")
        strongest = frequency[1:][np.argmax(amplitude[1:])]
        print(
            f"{line.name}: {F.mean():.0f} +- {F.std():.0f} N, {F.min():.0f} to {F.max():.0f} N, strongest at "
            f"{strongest:.2f} Hz = {strongest * line.period / v:.2f} waves per period of {line.period:g} m"
        )
    axes[0, 0].set_ylabel("contact force in N")
    axes[1, 0].set_ylabel("amplitude in N")
    fig.tight_layout()
    given.out.mkdir(parents=True, exist_ok=True)
    fig.savefig(given.out / "uneven_spans.png", dpi=130)


if __name__ == "__main__":
    main()
