"""What does the correction buy? Three controls on the same line and rig: how far energy and momentum run apart.

Cells for a notebook or an editor that knows `# %%`; run as a script it leaves `controllers.png`.
"""

# %% Ride with each.
import matplotlib.pyplot as plt
import numpy as np

from phil_loop import ClosedLoop, settings

controls = ("integrated_with_correction", "integrated", "cascaded")
records = {name: ClosedLoop(settings(speed_kmh=250, impedance_mpc={"control": name})).ride(10.0) for name in controls}

# %% Compare: the drive's error and the books (3.46), (3.47).
figure, (energy, momentum) = plt.subplots(2, sharex=True, figsize=(9, 6))
for name, record in records.items():
    error = np.sqrt(np.mean((record.rig.w_tr - record.wire.w_cat)[1000:] ** 2))
    print(
        f"{name}: {1e3 * error:.3f} mm rms, dE {record.books.delta_e[-1]:.3f} J, dp {record.books.delta_p[-1]:.3f} N s"
    )
    energy.plot(record.time, record.books.delta_e, label=name)
    momentum.plot(record.time, record.books.delta_p)
energy.set_ylabel("dE in J")
momentum.set(ylabel="dp in N s", xlabel="time in s")
energy.legend()
figure.savefig("controllers.png", dpi=130)
