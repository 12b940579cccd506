"""What does a ride of the whole loop look like? Catenary, controller and rig for 10 s at 250 km/h, without ROS.

Cells for a notebook or an editor that knows `# %%`; run as a script it leaves `closed_loop.png`.
"""

# %% Ride: every parameter of every node can be given to `settings`, docs/parameters.md lists them.
import matplotlib.pyplot as plt

from phil_loop import ClosedLoop, settings

record = ClosedLoop(settings(speed_kmh=250)).ride(10.0)
force = record.contact_statistics()
print(
    f"{record.outcome}: F_m {force.mean:.0f} N, sigma {force.sigma:.1f} N, {force.minimum:.0f} to {force.maximum:.0f} N"
)

# %% See: the record has the columns of the bag of such a ride, to the last bit.
figure, (above, middle, below) = plt.subplots(3, sharex=True, figsize=(9, 7))
above.plot(record.time, record.rig.f_tr, linewidth=0.6)
middle.plot(record.time, 1e3 * record.wire.w_cat, label="contact wire")
middle.plot(record.time, 1e3 * record.rig.w_tr, "--", label="drive")
below.plot(record.time, record.books.delta_e, label="dE in J")
below.plot(record.time, record.books.delta_p, label="dp in N s")
above.set_ylabel("contact force in N")
middle.set_ylabel("displacement in mm")
below.set_xlabel("time in s")
middle.legend()
below.legend()
figure.savefig("closed_loop.png", dpi=130)
