"""How does one get an absorbing boundary for one's own PDE? Terms, stencil, design, check.

The PDE is a string on an elastic bed, w_tt + k w = c^2 w_xx, which the library does not know. Below the
frequency sqrt(k) / 2 pi nothing travels along it; above it the longer a wave is the faster it runs, so that the end
that suits a string without a bed, w_t = c w_x, sends long waves back. The boundary that is designed here from the
discrete dispersion relation sends back less than a per cent, and the scheme with it is stable.
"""

import argparse
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from catenary_model import absorbing

C, BED = 100.0, 5.0  # m/s, Hz below which the bed lets no wave travel
DX, DT, LENGTH = 0.5, 0.004, 80.0  # m, s, m
BAND = (6.0, 30.0)  # Hz
TIMES = (0.0, 0.2, 0.4, 0.6, 0.8, 1.2)  # s
HIGHEST = 70.0  # Hz; this grid has waves up to 74 Hz


def string_on_bed() -> absorbing.Stencil:
    """Give the PDE's terms, whose sum is zero; every one becomes a difference."""
    terms = [
        absorbing.Term(1.0, time=2),
        absorbing.Term(-(C**2), space=(2,)),
        absorbing.Term((2.0 * np.pi * BED) ** 2),
    ]
    return absorbing.from_terms(terms, DX, DT, "string on an elastic bed", c=C, cut_off=BED)


def one_way(stencil: absorbing.Stencil) -> absorbing.BoundaryStencil:
    """Return what a string without a bed would take: w_t = c w_x between two nodes and two levels."""
    r = C * stencil.dt / stencil.dx[0]
    c = np.zeros((1, 2, 2))  # boundary node, level (0 is the new one), node from the boundary inwards
    c[0, 0, 1], c[0, 1, 0], c[0, 1, 1] = (r - 1.0) / (1.0 + r), (1.0 - r) / (1.0 + r), 1.0
    return absorbing.BoundaryStencil(c)


def main() -> None:
    """Draw the picture and print the figures that it shows."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path(), metavar="DIR", help="folder of picture and coefficients")
    parser.add_argument("--nodes", type=int, default=4, help="nodes that the boundary's update reads (4)")
    parser.add_argument("--levels", type=int, default=3, help="old time levels that it reads (3)")
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)

    stencil = string_on_bed()
    design = absorbing.design(stencil, "left", given.nodes, given.levels, absorbing.band(*BAND, outside=1e-3))
    design.write(given.out / "absorbing_boundary.json")

    ends = {
        "absorbing": design.boundary,
        "w_t = c w_x": one_way(stencil),
        "clamped": absorbing.clamped(stencil, "left"),
    }
    f = np.geomspace(1.02 * BED, HIGHEST, 200)
    nodes, beyond = round(LENGTH / DX) + 1, round(LENGTH / DX)
    x = DX * np.arange(nodes)
    start = 0.5 * np.exp(-(((x - 0.5 * LENGTH) / 4.0) ** 2))
    steps = round(TIMES[-1] / DT)
    # The same string without that end: it goes on to the left, too far for anything to come back in time.
    longer = np.concatenate([np.zeros(beyond), start])
    unbounded = absorbing.run(stencil, None, None, longer, steps)[:, beyond:]

    runs, shares = {}, {}
    for name, end in ends.items():
        runs[name] = absorbing.run(stencil, end, None, start, steps)
        shares[name] = np.abs(absorbing.reflection(stencil, end, f))
        inside = (f >= BAND[0]) & (f <= BAND[1])
        left = np.abs(runs[name] - unbounded).max()
        print(
            f"{name}: at most {100 * shares[name][inside].max():.2f} % reflected from {BAND[0]:g} to {BAND[1]:g} Hz, "
            f"{100 * left / start.max():.2f} % of the initial deflection in time, spectral radius - 1: "
            f"{max(absorbing.radius(stencil, end, None, n) for n in (12, 40, nodes)) - 1.0:.1e}"
        )

    fig, axes = plt.subplot_mosaic("ww;re", figsize=(12, 8), height_ratios=(1.1, 1), layout="constrained")
    colours = {"clamped": "C2", "w_t = c w_x": "C1", "absorbing": "C0"}
    for number, time in enumerate(TIMES):
        row, shift = round(time / DT), -0.4 * number
        for name, colour in colours.items():
            axes["w"].plot(x, runs[name][row] + shift, color=colour, linewidth=1.2, label=None if number else name)
        axes["w"].plot(x, unbounded[row] + shift, "k--", linewidth=0.9, label=None if number else "unbounded")
        axes["w"].text(LENGTH + 1.0, shift, f"{time:.1f} s", va="center")
    axes["w"].set(xlabel="x in m; three ends at 0, clamped at 80", ylabel="displacement, shifted", xlim=(0.0, LENGTH))
    axes["w"].legend(loc="upper right")
    for name, colour in colours.items():
        axes["r"].loglog(f, 100.0 * shares[name], color=colour, label=name)
        apart = np.abs(runs[name] - unbounded).max(axis=1) / start.max()
        axes["e"].semilogy(DT * np.arange(steps + 1), 100.0 * np.maximum(apart, 1e-9), color=colour, label=name)
    axes["r"].axvspan(*BAND, color="0.9", label="designed for")
    axes["r"].set(xlabel="frequency in Hz", ylabel="reflected amplitude in %", ylim=(1e-2, 200.0), xlim=(f[0], f[-1]))
    axes["e"].set(xlabel="time in s", ylabel="largest difference to unbounded in %", ylim=(1e-4, 200.0))
    for key in "re":
        axes[key].grid(alpha=0.3, which="both")
        axes[key].legend()
    fig.savefig(given.out / "absorbing_boundary.png", dpi=130)


if __name__ == "__main__":
    main()
