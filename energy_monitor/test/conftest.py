"""Bags of rides whose numbers are known in closed form, written without ROS."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from energy_monitor.contact_quality import ContactQuality

INTERFACES = Path(__file__).resolve().parents[2] / "interfaces" / "phil_interfaces" / "msg"
TS = 0.002
EPOCH = 1_700_000_000_000_000_000  # ns, log time of the first message


@dataclass
class SyntheticRide:
    """A ride at constant speed with force 120 N + 30 N sin(10 pi t); the rig follows the wire `lag` seconds late."""

    cycles: int = 1500
    speed_kmh: float = 250.0
    mean_force: float = 120.0
    amplitude: float = 30.0  # N, of the force at 5 Hz
    wire: float = 0.02  # m, amplitude of the wire at 2 Hz
    lag: float = 0.8e-3  # s
    velocity: float = 0.1  # m/s, amplitude of both velocities at 5 Hz, in phase with the force
    velocity_error: float = 1e-4  # m/s, v_cat - v_tr
    correction: float = 0.5  # N, f_cor, constant
    forecast_error: float = 0.0  # N, force predicted for the next cycle - the one that comes
    leak: float = 1e-3  # W, what the rig's meter of work counts and the catenary's does not
    push: float = 0.0  # N, the same of the meters of impulse, beside f_cor
    start_error: float = 0.0  # m and m/s, additional errors of position and velocity before 2 s
    turn: int | None = None  # cycle from which velocity_error, leak and push have the other sign
    environments: dict[int, int] = field(default_factory=dict)  # environment from a cycle on
    bound: float = 10.0  # N, |f_cor| at most
    missing: tuple[int, ...] = ()  # cycles without a rig state
    repeated: tuple[int, ...] = ()  # cycles whose rig state was sent twice
    modes: dict[int, int] = field(default_factory=dict)  # rig mode from a cycle on
    no_contact: tuple[int, ...] = ()  # cycles with zero force
    mismatches: tuple[int, ...] = ()  # cycles whose force did not reach the catenary as it was sent
    fallbacks: tuple[int, ...] = ()  # cycles that the controller answered by its old plan
    quality_error: float = 0.0  # N, slip in the monitor's mean force
    last: bool = True
    segment: int = 6
    beside: tuple[tuple[float, float], ...] = ()
    """Further pantographs: place in m, and amplitude in N of a force of 100 N + amplitude sin(2 pi 2 Hz t)."""
    books_error: float = 0.0  # J, slip in the monitor's dE
    without: tuple[str, ...] = ()  # topics that are left out
    lacking: tuple[str, ...] = ()  # fields that the messages do not have, as "CatenaryState.work"
    namespace: str = ""
    wall_factor: float = 2.0  # simulated over wall time
    first: int = 0


def columns(ride: SyntheticRide) -> dict[str, np.ndarray]:
    """The ride's signals, one entry a cycle."""
    cycle = np.arange(ride.first, ride.first + ride.cycles)
    t = cycle * TS
    f_tr = ride.mean_force + ride.amplitude * np.sin(10.0 * math.pi * t)
    f_tr[np.isin(cycle, ride.no_contact)] = 0.0
    v_tr = ride.velocity * np.sin(10.0 * math.pi * t)
    w_cat = 0.05 + ride.wire * np.sin(4.0 * math.pi * t)
    w_tr = 0.05 + ride.wire * np.sin(4.0 * math.pi * (t - ride.lag))
    w_tr[t < 2.0] += ride.start_error
    sign = np.where(cycle < (math.inf if ride.turn is None else ride.turn), 1.0, -1.0)
    v_cat = v_tr + ride.velocity_error * sign
    v_cat[t < 2.0] -= ride.start_error
    mode = np.ones(len(cycle), int)
    for start, number in sorted(ride.modes.items()):
        mode[cycle >= start] = number
    environment = np.zeros(len(cycle), int)
    for start, number in sorted(ride.environments.items()):
        environment[cycle >= start] = number
    f_cor = np.full(len(cycle), ride.correction)
    # Force of cycle k on the wire: what the command of cycle k - 1 asked for, with a perfect forecast F_tr + F_cor.
    f_predicted = np.append(f_tr[1:], f_tr[-1]) + ride.forecast_error
    sent = f_predicted + np.where(environment == 0, f_cor, 0.0)
    f_cat = np.append(f_tr[0] + ride.correction, sent[:-1])
    meters = {
        "work": np.cumsum(TS * f_tr * v_tr),
        "impulse": np.cumsum(TS * f_tr),
    }
    meters["work_cat"] = meters["work"] - np.cumsum(TS * ride.leak * sign)
    meters["impulse_cat"] = meters["impulse"] + np.cumsum(TS * (ride.correction + ride.push * sign))
    return {
        "cycle": cycle, "t": t, "f_tr": f_tr, "v_tr": v_tr, "w_cat": w_cat, "w_tr": w_tr, "v_cat": v_cat, "mode": mode,
        "f_cor": f_cor, "f_predicted": f_predicted, "f_cat": f_cat, "environment": environment, "sent": sent,
        **{name: values - values[0] for name, values in meters.items()},
    }  # fmt: skip


@cache
def types_without(lacking: tuple[str, ...]) -> Typestore:
    """Give the types of a ride, without some fields of some messages; their code is compiled once."""
    store = get_typestore(Stores.ROS2_JAZZY)
    types: dict[str, Any] = {}
    for file in sorted(INTERFACES.glob("*.msg")):
        absent = [name.split(".")[1] for name in lacking if name.split(".")[0] == file.stem]
        lines = ((line.split("#")[0].split(), line) for line in file.read_text().splitlines())
        kept = [line for words, line in lines if len(words) < 2 or words[1] not in absent]
        types.update(get_types_from_msg("\n".join(kept), f"phil_interfaces/msg/{file.stem}"))
    store.register({name: kind for name, kind in types.items() if name not in store.fielddefs})
    return store


def write_ride(
    path: Path, ride: SyntheticRide | None = None, *, sqlite: bool = False, compressed: bool = False
) -> Path:
    """Write the ride's bag to the folder `path`."""
    ride = ride or SyntheticRide()
    store = types_without(ride.lacking)
    writer = Writer(path, version=9, storage_plugin=StoragePlugin.SQLITE3 if sqlite else StoragePlugin.MCAP)
    if compressed:
        writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    with writer:
        connections: dict[str, Any] = {}
        for log_time, topic, kind, message in sorted(_messages(ride, store), key=lambda entry: entry[0]):
            if topic in ride.without:
                continue
            name = topic if topic.startswith("/") else f"{ride.namespace}/{topic}"
            if name not in connections:
                connections[name] = writer.add_connection(name, kind, typestore=store)
            writer.write(connections[name], log_time, store.serialize_cdr(message, kind))
    return path


def _messages(ride: SyntheticRide, store: Any) -> Iterable[tuple[int, str, str, Any]]:
    """Yield (log time, topic, type, message) of the whole ride."""
    types = store.types
    stamp_type, header_type = types["builtin_interfaces/msg/Time"], types["std_msgs/msg/Header"]
    c = columns(ride)
    step = round(TS * 1e9 / ride.wall_factor)

    fields = {
        kind.rsplit("/", 1)[1]: {entry[0] for entry in definition[1]}
        for kind, definition in store.fielddefs.items()
        if kind.startswith("phil_interfaces/")
    }
    lacking = {name: {one.split(".")[1] for one in ride.lacking if one.split(".")[0] == name} for name in fields}

    def header(cycle: int, frame: str) -> Any:
        seconds, rest = divmod(cycle * 2_000_000, 10**9)
        return header_type(stamp_type(seconds, rest), frame)

    def make(name: str, **values: Any) -> tuple[str, Any]:
        kind = f"phil_interfaces/msg/{name}"
        known = fields[name]
        absent = lacking.get(name, set())
        assert values.keys() - absent == known
        return kind, types[kind](**{key: value for key, value in values.items() if key in known})

    model = np.eye(2).ravel()
    yield EPOCH, "catenary_model/impedance_model", *make(
        "ImpedanceModel", header=header(0, "train"), cycle=0, description="a test", n=2, ts=TS, newmark_beta=0.25,
        newmark_gamma=0.5, mass=model, damping=model, stiffness=model, input=np.ones(2), output=np.ones(2),
        local_compliance=0.0,
    )  # fmt: skip
    e_tr = e_cat = p_tr = p_cat = energy = momentum = 0.0
    quality = ContactQuality(TS, 2.0, 2.0)
    before = None
    counted = np.isin(c["mode"], (1, 2, 3)) & (c["environment"] == 0)
    meters = dict.fromkeys(("work", "work_cat", "impulse", "impulse_cat"), 0.0)
    batch: list[float] = []
    for i, k in enumerate(c["cycle"].tolist()):
        at = EPOCH + i * step
        f_tr, v_tr, v_cat, f_cor, f_cat = (float(c[name][i]) for name in ("f_tr", "v_tr", "v_cat", "f_cor", "f_cat"))
        rig = make(
            "RigState", header=header(k, "rig"), cycle=k, mode=int(c["mode"][i]),
            last=ride.last and i == ride.cycles - 1,
            w_tr=c["w_tr"][i], v_tr=v_tr, f_tr=f_tr, f_raw=f_tr, reference=c["w_tr"][i], current=1.0, work=c["work"][i],
            impulse=c["impulse"][i], late_commands=0,
        )  # fmt: skip
        for _ in range(0 if k in ride.missing else 2 if k in ride.repeated else 1):
            yield at, "test_rig_sim/state", *rig
        segment = np.full(ride.segment, float(k))
        yield at, "catenary_model/state", *make(
            "CatenaryState", header=header(k, "train"), cycle=k, w_cat=c["w_cat"][i], v_cat=v_cat, a_cat=0.0,
            f_cat=f_cat + (1.0 if k - 1 in ride.mismatches else 0.0), work=c["work_cat"][i],
            impulse=c["impulse_cat"][i], track_position=k * TS * ride.speed_kmh / 3.6, speed=ride.speed_kmh / 3.6,
            droppers=36,
            slack_droppers=int(k % 4 == 0), iterations=1 + int(k % 4 == 0), segment_displacement=segment,
            segment_velocity=segment, segment_acceleration=segment, segment_force=segment,
            companion_place=np.array([place for place, _ in ride.beside]),
            companion_force=np.array([100.0 + size * np.sin(4.0 * np.pi * k * TS) for _, size in ride.beside]),
            companion_height=np.zeros(len(ride.beside)), companion_loss=np.zeros(len(ride.beside)),
        )  # fmt: skip
        yield at + 1, "impedance_mpc/command", *make(
            "ImpedanceCommand", header=header(k, "rig"), cycle=k, u_tr=0.0, u_tr_next=0.0, f_tr=f_tr,
            f_predicted=c["f_predicted"][i], f_cor=f_cor, f_cat=c["sent"][i],
            f_cor_lower=-ride.bound, f_cor_upper=ride.bound, correction=1, environment=int(c["environment"][i]),
            w_env=c["w_cat"][i], v_env=v_cat,
            status=2 if k in ride.fallbacks else 0,
            iterations=3 + k % 2, fallbacks=0,
        )  # fmt: skip
        if counted[i]:
            e_tr += TS * f_tr * v_tr
            e_cat += TS * f_cat * v_cat
            energy += TS * abs(f_tr * v_tr)
            p_tr += TS * f_tr
            p_cat += TS * f_cat
            momentum += TS * abs(f_tr)
            for name in meters if before is not None else ():
                meters[name] += c[name][i] - c[name][before]
        before = i
        if k % 10 == 0:
            for node, slip in (("energy_monitor", ride.books_error), ("impedance_mpc", 0.0)):
                yield at + 2, f"{node}/conserved_quantities", *make(
                    "ConservedQuantities", header=header(k, "rig"), cycle=k, e_tr=e_tr, e_cat=e_cat,
                    delta_e=e_tr - e_cat + slip, p_tr=p_tr, p_cat=p_cat, delta_p=p_tr - p_cat, exchanged_energy=energy,
                    exchanged_momentum=momentum, work_tr=meters["work"], work_cat=meters["work_cat"],
                    delta_work=meters["work"] - meters["work_cat"] + slip, impulse_tr=meters["impulse"],
                    impulse_cat=meters["impulse_cat"],
                )  # fmt: skip
        quality.add(k, f_tr)
        if k % 50 == 0 and quality.samples:
            found = quality.statistics
            yield (
                at + 2,
                "energy_monitor/contact_quality",
                *make(
                    "ContactQuality", header=header(k, "rig"), cycle=k, samples=found.samples, force=quality.force,
                    mean=found.mean + ride.quality_error, sigma=found.sigma, minimum=found.minimum,
                    maximum=found.maximum, statistical_minimum=found.statistical_minimum,
                    statistical_maximum=found.statistical_maximum, loss_share=found.loss_share, losses=found.losses,
                ),
            )  # fmt: skip
        if k % 20 == 0:
            x = np.linspace(-60.0, 60.0, 121, dtype=np.float32)
            place = k * TS * ride.speed_kmh / 3.6
            droppers = (np.arange(-57.0, 60.0, 6.5) - place % 6.5)[: 18 - (k // 20) % 2].astype(np.float32)
            bow = -0.05 * np.exp(-(x**2) / 50.0)
            yield at + 2, "catenary_model/wire_shape", *make(
                "WireShape", header=header(k, "train"), cycle=k, track_position=place, x=x,
                contact=-bow.astype(np.float32),
                carrier=(1.2 - 0.8 * np.sin(np.pi * (x + place) / 60.0) ** 2).astype(np.float32), dropper_x=droppers,
                dropper_force=np.where(np.abs(droppers) < 5.0, 0.0, 90.0).astype(np.float32),
                mast_x=np.array([-60.0, 0.0, 60.0], np.float32) - np.float32(place % 60.0),
            )  # fmt: skip
        batch.append(2e-4 + 1e-6 * (k % 100))
        if len(batch) == 50:
            for node in ("test_rig_sim", "impedance_mpc", "catenary_model", "energy_monitor"):
                yield at + 3, f"{node}/timing", *make(
                    "CycleTiming", header=header(k, "rig"), cycle=k, budget=TS, turnaround=np.array(batch, np.float32),
                    late=k // 500, missing=0, stale=0, refused=0, messages_late=k // 1000, messages_lost=k // 400,
                    messages_doubled=len(node), messages_swapped=0,
                )  # fmt: skip
            batch = []
        if k % 500 == 0:
            status = types["diagnostic_msgs/msg/DiagnosticStatus"]
            pair = types["diagnostic_msgs/msg/KeyValue"]("late", "1")
            entries = [
                status(0, "catenary_model: cycle", "all well", "", []),
                status(1, "energy_monitor: books", "dE <b>differs</b> & more", "", [pair]),
            ]
            kind = "diagnostic_msgs/msg/DiagnosticArray"
            yield at + 4, "/diagnostics", kind, types[kind](header(k, ""), entries)


@pytest.fixture(scope="session")
def synthetic() -> Callable[..., Path]:
    """Writer of synthetic bags: `synthetic(folder, sqlite=False, **ride)`."""

    def write(path: Path, *, sqlite: bool = False, compressed: bool = False, **ride: Any) -> Path:
        return write_ride(path, SyntheticRide(**ride), sqlite=sqlite, compressed=compressed)

    return write


@pytest.fixture(scope="session")
def ride_bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A good ride of 3 s."""
    return write_ride(tmp_path_factory.mktemp("ride") / "bag")
