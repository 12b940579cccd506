"""What does a dropper send back of a wave? As much as a tie between two strings does, until it goes slack.

A taut dropper ties the contact wire to the carrier. A wave that comes along moves both, so part of it is sent back,
part goes on, and part leaves along the carrier. For two strings with impedances Z = sqrt(T rhoA) and a rigid tie the
share sent back is Z_ca / (Z_ca + Z_co) of the amplitude, at every frequency; a spring k_d adds i omega / k_d to the
tie. A wave that lifts the wire by more than the dropper is stretched makes it slack: then it ties nothing, and sends
back less.
"""

import argparse
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from catenary_model.line import Dropper, Line, Span
from catenary_model.model import Catenary, Config

FREQUENCY, LENGTH, SOURCE, WATCHED = 12.0, 0.25, -60.0, -30.0  # Hz, s, m from the dropper, m
TS, END = 0.002, 1.05  # s
# One dropper far from all masts. Under full gravity it would carry 90 m of wire; so it carries 100 N, like one of nine.
LINE = Line(spans=(Span(180.0, (Dropper(90.0),)),), gravity=0.8)
WITHOUT = Line(spans=(Span(180.0, ()),))


def send(force: float, line: Line = LINE) -> tuple[Catenary, np.ndarray]:
    """Push the contact wire of the standing line; return model and velocity of both wires, (cycles, x, wire)."""
    catenary = Catenary(Config(line=line, speed=0.0, start_position=90.0, spans=1, layer_behind=30.0, layer_ahead=30.0))
    at = int(np.argmin(np.abs(catenary.mesh.x - SOURCE)))
    seen = []
    for t in TS * np.arange(1, round(END / TS) + 1):
        packet = np.sin(2 * np.pi * FREQUENCY * t) * np.sin(np.pi * t / LENGTH) ** 2 if t < LENGTH else 0.0
        catenary.external_load[at, 1, 0] = force * packet
        catenary.step(0.0)
        seen.append(catenary.deviation[1, :, :, 0].copy())
    return catenary, np.array(seen)


def sent_back(x: np.ndarray, with_dropper: np.ndarray, without: np.ndarray) -> float:
    """Amplitude of what comes back over that of the wave without dropper, both as far from it and as far run."""
    here, beyond = (int(np.argmin(np.abs(x - at))) for at in (WATCHED, -WATCHED))
    return float(np.linalg.norm((with_dropper - without)[:, here, 1]) / np.linalg.norm(without[:, beyond, 1]))


def main() -> None:
    """Draw the picture and print the figures that it shows."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path(), metavar="DIR", help="folder of the picture (here)")
    parser.add_argument("--force", nargs="+", type=float, default=[50, 100, 200, 400, 600, 800, 1200], help="N")
    given = parser.parse_args()

    Z_ca, Z_co = (np.sqrt(wire.tension * wire.mass_per_length) for wire in (LINE.carrier, LINE.contact))
    tie = 2j * np.pi * FREQUENCY / LINE.spans[0].droppers[0].stiffness
    expected = abs(0.5 / Z_co / (0.5 / Z_co + 0.5 / Z_ca + tie))
    rides = [send(force) for force in given.force]
    _, free = send(1.0, WITHOUT)
    shares = [
        sent_back(model.mesh.x, seen, force * free) for force, (model, seen) in zip(given.force, rides, strict=True)
    ]
    for force, share in zip(given.force, shares, strict=True):
        print(f"pushed with {force:g} N: {100 * share:.1f} % sent back (two strings, taut: {100 * expected:.1f} %)")

    fig, axes = plt.subplots(1, 3, figsize=(14, 4.5), width_ratios=(1, 1, 0.8))
    catenary, seen = rides[0]
    for axis, wire, name in ((axes[0], 1, "contact wire"), (axes[1], 0, "carrier")):
        top = np.abs(seen[:, :, 1]).max()
        extent = (catenary.mesh.x[0], catenary.mesh.x[-1], 0.0, END)
        axis.imshow(seen[:, :, wire], origin="lower", aspect="auto", cmap="RdBu_r", vmin=-top, vmax=top, extent=extent)
        axis.axvline(0.0, color="black", linewidth=0.8)
        axis.set(
            title=f"{name}, pushed with {given.force[0]:g} N", xlabel="distance from the dropper in m", xlim=(-90, 90)
        )
    axes[0].set_ylabel("time in s")
    axes[2].plot(given.force, 100 * np.array(shares), "o-", label="model")
    axes[2].axhline(100 * expected, color="black", linestyle="--", label="two strings, taut dropper")
    axes[2].set(xlabel="push in N", ylabel="amplitude sent back in %", ylim=(0.0, 55.0))
    axes[2].legend()
    fig.tight_layout()
    given.out.mkdir(parents=True, exist_ok=True)
    fig.savefig(given.out / "wave_past_dropper.png", dpi=130)


if __name__ == "__main__":
    main()
