"""What the controller believes of the rig beside what the simulated rig has, from a ride's parameters alone.

The controller's figures are its own: a real rig's are measured and typed in. So they do not follow when the simulated
rig is changed, and a controller that is wrong about its rig is a study only if somebody knows.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from phil_base.parameters import ParameterError, config_file, defaults, read_file

APART = 0.01
"""1, difference over the larger of both that is worth a mark."""
HEAD_MASS = {"en50318": 7.2, "three_mass": 7.5, "benchmark": 7.5, "dsa380": 7.12, "dsa250": 7.51, "nonlinear": 7.2}
"""kg, what moves with the head of test_rig_sim's pantographs; that of a state-space file is not known."""
RIGS = ("nominal", "ideal", "harsh")
"""Rigs whose closed position loop was identified."""

_OF_LOOP = ("drive.", "structure.", "inner_loop.", "observer.")
_OF_LOOP_SWITCHES = ("friction", "cogging", "current_limit", "current_slew", "delay", "encoder", "structure")
_OF_LOOP_ALONE = ("cycle_time", "inner_steps", "substeps", "encoder_resolution")
_PT2 = ("rig_natural_frequency_hz", "rig_damping_ratio", "rig_delay")


@dataclass(frozen=True)
class Belief:
    """One figure: the controller's parameter and the value it believes in, and what the rig has (None: not known)."""

    name: str
    parameter: str
    of_rig: str
    believed: float
    has: float | None
    unit: str = field(default="1")

    @property
    def apart(self) -> float | None:
        """Difference over the larger of both, 1; None if the rig's is not known."""
        if self.has is None:
            return None
        largest = max(abs(self.believed), abs(self.has))
        return abs(self.believed - self.has) / largest if largest > 0.0 else 0.0

    @property
    def differs(self) -> bool:
        """Whether it is worth a mark: too far apart, or nobody knows."""
        return self.apart is None or self.apart > APART


def beliefs(parameters: Mapping[str, Mapping[str, Any]]) -> list[Belief]:
    """Give what the controller believes, from node to flat parameter to value; empty without a simulated rig."""
    rig, own = parameters.get("test_rig_sim"), parameters.get("impedance_mpc")
    if not rig or not own:
        return []
    return [*_of_contact(own, rig), *_of_loop(own, rig)]


def remark(parameters: Mapping[str, Mapping[str, Any]]) -> str | None:
    """Say in one line where the controller's figures are not the simulated rig's; None: they agree."""
    said = [_said(belief) for belief in beliefs(parameters) if belief.differs]
    return f"the controller believes otherwise than the rig is: {'; '.join(said)}" if said else None


def _said(belief: Belief) -> str:
    has = "is not known" if belief.has is None else f"is {belief.has:g}"
    unit = "" if belief.unit == "1" else f" {belief.unit}"
    return f"{belief.parameter} {belief.believed:g}{unit}, the rig's {has}"


def _of_contact(own: Mapping[str, Any], rig: Mapping[str, Any]) -> list[Belief]:
    """What the forecast of the contact force works with."""
    kind, found = own.get("forecast.kind"), []
    if kind == "contact":
        stiffness, damping = rig.get("contact.stiffness"), rig.get("contact.damping")
        mass = HEAD_MASS.get(str(rig.get("pantograph")))
        if "forecast.stiffness" in own and stiffness is not None:
            found.append(
                Belief(
                    "Contact stiffness", "forecast.stiffness", "contact.stiffness",
                    float(own["forecast.stiffness"]), float(stiffness), "N/m",
                )
            )  # fmt: skip
        if damping is not None:
            found.append(
                Belief("Contact damping", "(none in its forecast)", "contact.damping", 0.0, float(damping), "N s/m")
            )
        if "forecast.head_mass" in own:
            found.append(
                Belief(
                    "Mass of the head", "forecast.head_mass", "pantograph", float(own["forecast.head_mass"]), mass, "kg"
                )
            )
    if kind in ("contact", "linear") and "forecast.noise" in own and "load_cell.noise" in rig:
        noise = float(rig["load_cell.noise"]) if rig.get("imperfections.load_cell_noise", True) else 0.0
        found.append(
            Belief(
                "Noise of the measured force",
                "forecast.noise",
                "load_cell.noise",
                float(own["forecast.noise"]),
                noise,
                "N",
            )
        )
    return found


def _of_loop(own: Mapping[str, Any], rig: Mapping[str, Any]) -> list[Belief]:
    """The rig's closed position loop, beside what was identified on a rig with these parameters."""
    if not all(name in own for name in _PT2):
        return []
    identified = _identified(rig)
    later = float(rig.get("command_delay", 0)) * float(rig.get("cycle_time", 0.0))
    names = ("Natural frequency of the rig", "Damping ratio of the rig", "Dead time of the rig")
    found = []
    for name, parameter, unit in zip(names, _PT2, ("Hz", "1", "s"), strict=True):
        has = identified.get(parameter)
        if has is not None and parameter == "rig_delay":
            has += later
        found.append(Belief(name, parameter, "identified on it", float(own[parameter]), has, unit))
    return found


def _identified(rig: Mapping[str, Any]) -> Mapping[str, float]:
    """Find the shipped rig whose position loop has the same parameters, and what was identified on it."""
    try:
        usual = defaults("test_rig_sim")
        for name in RIGS:
            whole = {**usual, **read_file(config_file("test_rig_sim", f"rigs/{name}.yaml"))["test_rig_sim"]}
            if all(whole[key] == rig.get(key, whole[key]) for key in whole if _shapes_the_loop(key)):
                found = read_file(config_file("impedance_mpc", f"identified/{name}.yaml"))["impedance_mpc"]
                return {key: float(found[key]) for key in _PT2}
    except (ParameterError, KeyError):
        pass  # a monitor on its own, without the other packages
    return {}


def _shapes_the_loop(key: str) -> bool:
    group, _, rest = key.partition(".")
    if group == "imperfections":
        return rest in _OF_LOOP_SWITCHES
    return key in _OF_LOOP_ALONE or key.startswith(_OF_LOOP)
