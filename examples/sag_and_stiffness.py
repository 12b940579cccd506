"""How deep does the contact wire hang, and how hard is it to lift? Sag and static stiffness along every preset.

Two figures of a line decide how smooth a ride is before anything moves: the height of the wire, which the pantograph
has to follow, and its stiffness, which turns a steady force into an uneven path. Both come from statics alone
(`catenary_model.statics`, `catenary_model.stiffness`). A strong push makes the dropper above it slack: the line gets
softer just where it was stiffest.
"""

import argparse
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from catenary_model import statics
from catenary_model.line_file import load_line, preset_names
from catenary_model.stiffness import PushedLine

COLOURS = ("tab:blue", "tab:orange", "tab:red")


def main() -> None:
    """Draw the picture and print the figures that it shows."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path(), metavar="DIR", help="folder of the picture (here)")
    parser.add_argument("--line", nargs="+", default=preset_names(), help="presets or YAML files (all presets)")
    parser.add_argument("--force", nargs="+", type=float, default=[100.0, 250.0, 400.0], help="N (100 250 400)")
    given = parser.parse_args()
    try:
        lines = [load_line(name) for name in given.line]
    except ValueError as error:
        parser.error(str(error))

    fig, axes = plt.subplots(2, len(given.line), figsize=(5 * len(given.line), 6), sharex="col", squeeze=False)
    for (above, below), line in zip(axes.T, lines, strict=True):
        rest = statics.solve(line)
        pushed = PushedLine(rest)
        zeta = np.linspace(0.0, line.period, round(2 * line.period) + 1)
        above.plot(zeta, 1e3 * rest.contact(zeta), color="black")
        above.plot(rest.dropper_positions, 1e3 * rest.contact(rest.dropper_positions), "k.", label="clamps of droppers")
        above.set_title(line.name)
        print(f"{line.name}: lowest {1e3 * rest.contact(zeta).min():.1f} mm")
        for force, colour in zip(given.force, COLOURS * len(given.force), strict=False):
            k = pushed.stiffness(zeta, force)
            below.plot(zeta, 1e-3 * k, color=colour, label=f"{force:g} N")
            uneven = (k.max() - k.min()) / (k.max() + k.min())
            print(f"  pushed with {force:g} N: {k.min():.0f} to {k.max():.0f} N/m, unevenness {100 * uneven:.0f} %")
        for axis in (above, below):
            for mast in (*line.span_starts, line.period):
                axis.axvline(mast, color="0.8", linewidth=3, zorder=0)
        below.set(xlabel="track position in m (grey: masts)", ylim=(0.0, None))
    axes[0, 0].set_ylabel("height at rest in mm")
    axes[1, 0].set_ylabel("static stiffness in kN/m")
    axes[0, 0].legend(loc="lower right", bbox_to_anchor=(0.96, 0.1))
    axes[1, 0].legend(title="pushed with")
    fig.tight_layout()
    given.out.mkdir(parents=True, exist_ok=True)
    fig.savefig(given.out / "sag_and_stiffness.png", dpi=130)


if __name__ == "__main__":
    main()
