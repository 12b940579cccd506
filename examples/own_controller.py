"""How good is a controller of one's own? One that only looks 4 ms ahead, in the place of ours.

Cells for a notebook or an editor that knows `# %%`; run as a script it leaves `own_controller.png`.
"""

# %% A controller has two methods (`phil_loop.Controller`): the command of a cycle, and a fresh start.
import matplotlib.pyplot as plt

from impedance_mpc.controller import Command, EnvironmentReading, RigReading
from phil_loop import ClosedLoop, settings


class Lead:
    """Refer the drive to where the wire will be after ``lead`` seconds if it keeps its velocity."""

    def __init__(self, lead: float, ts: float = 0.002) -> None:
        self.lead, self.ts = lead, ts

    def command(self, rig: RigReading, wire: EnvironmentReading, following: bool) -> Command:
        """Give the ramp from t_k to t_(k+1), and the force that was measured to the wire."""
        u = wire.w + self.lead * wire.v
        return Command(u_tr=u, u_tr_next=u + self.ts * wire.v, f_tr=rig.f_tr, f_predicted=rig.f_tr, f_cat=rig.f_tr)

    def reset(self) -> None:
        """Forget nothing: there is no memory."""


# %% Ride with it and with ours.
for name, controller in {"ours": None, "lead of 4 ms": Lead(0.004)}.items():
    record = ClosedLoop(settings(speed_kmh=250), controller).ride(10.0)
    print(f"{name}: {record.outcome} {record.reason}, dE {record.books.delta_e[-1]:.2f} J in {record.cycles} cycles")
    plt.plot(record.time, 1e3 * (record.rig.w_tr - record.wire.w_cat), label=name, linewidth=0.6)
plt.xlabel("time in s")
plt.ylabel("error of the drive in mm")
plt.legend()
plt.savefig("own_controller.png", dpi=130)
