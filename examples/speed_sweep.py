"""What happens near the speed of the waves in the contact wire? Contact force and uplift from 0.1 c to 0.9 c.

The waves of a contact wire run with c = sqrt(T / rhoA), 438 km/h for the reference line. The faster the train, the
less the wave ahead of the pantograph gets away from it: the wire in front stays as it was until shortly before, the
wire behind is left shaking, the contact force swings wider and contact is lost. This is why tension, not power,
limits the speed of electric trains; standards allow 0.7 c.
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
START = 3.0  # s, in which the uplift comes up and the first waves run off


def main() -> None:
    """Draw the picture and print the figures that it shows."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path(), metavar="DIR", help="folder of the picture (here)")
    parser.add_argument("--line", default="en50318_2002", help="preset or YAML file (en50318_2002)")
    parser.add_argument("--speeds", type=int, default=17, help="number of speeds from 0.1 c to 0.9 c (17)")
    parser.add_argument("--spans", type=int, default=8, help="ridden over at every speed once all is under way (8)")
    given = parser.parse_args()
    try:
        line = load_line(given.line)
    except ValueError as error:
        parser.error(str(error))
    c = line.contact.wave_speed
    length = line.period / len(line.spans)

    share = np.linspace(0.1, 0.9, given.speeds)
    mean, sigma, low, high, uplift, lost = np.zeros((6, given.speeds))
    for i, speed in enumerate(share * c):
        # near c the wave ahead needs a long layer to get away from the pantograph
        catenary = Catenary(Config(line=line, speed=float(speed), layer_ahead=300.0))
        rode = ride(catenary, EN50318, START + given.spans * length / speed, START)
        F, rest = rode.F[rode.t > START], catenary.statics.contact(rode.track[rode.t > START])
        mean[i], sigma[i], low[i], high[i] = F.mean(), F.std(), F.min(), F.max()
        uplift[i] = (rode.w[rode.t > START] - rest).max()
        lost[i] = np.mean(F <= 0.0)
        print(
            f"{share[i]:.2f} c, {3.6 * speed:3.0f} km/h: contact force {mean[i]:.0f} +- {sigma[i]:.0f} N, "
            f"{low[i]:.0f} to {high[i]:.0f} N, lost {100 * lost[i]:.1f} % of the time, uplift {1e3 * uplift[i]:.0f} mm"
        )

    fig, axes = plt.subplots(3, 1, figsize=(8, 9), sharex=True)
    axes[0].fill_between(share, low, high, color="0.85", label="smallest to largest")
    axes[0].fill_between(share, mean - sigma, mean + sigma, color="tab:blue", alpha=0.4, label="mean +- sigma")
    axes[0].plot(share, mean, color="tab:blue")
    axes[0].set_ylabel("contact force in N")
    axes[0].legend(loc="upper left")
    axes[1].plot(share, 100 * lost, "o-", color="tab:red")
    axes[1].set_ylabel("contact lost in % of the time")
    axes[2].plot(share, 1e3 * uplift, "o-", color="black")
    axes[2].set(ylabel="largest uplift at the pantograph in mm", xlabel="speed of the train / speed of waves")
    axes[0].set_title(f"{line.name}, EN 50318 pantograph with 120 N, c = {3.6 * c:.0f} km/h")
    for axis in axes:
        axis.axvline(0.7, color="black", linestyle=":")
    fig.tight_layout()
    given.out.mkdir(parents=True, exist_ok=True)
    fig.savefig(given.out / "speed_sweep.png", dpi=130)


if __name__ == "__main__":
    main()
