"""Does the ride hold? The requirements, their limits from YAML, and a verdict on each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from energy_monitor import limits as contact_limits
from energy_monitor.contact_quality import ContactStatistics
from energy_monitor.limits import LimitsError
from energy_monitor.report.alignment import Aligned
from energy_monitor.report.results import TRUTH, Agreement, Conservation, ContactForce, Tracking, Verdict
from phil_base.parameters import config_file
from phil_base.yaml_file import YamlError, read_yaml

__all__ = ["Limits", "LimitsError", "judge", "read_limits"]


STANDARD = "en50367_ac"
"""Standard for the contact force where neither limits nor parameters name one."""

_RUN_IN_ONLY = "not judged: the ride is not longer than its run-in"
_OF_EXCHANGED = "largest difference from the recomputed sums over what was exchanged"


class Limits(BaseModel):
    """Limits of the verdicts, in the units of `config/report_limits.yaml`."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    position_error_rms: float = Field(ge=0.0)
    energy_error_share: float = Field(ge=0.0)
    work_error_share: float = Field(ge=0.0)
    momentum_error_share: float = Field(ge=0.0)
    impulse_error_share: float = Field(ge=0.0)
    loss_share: float = Field(ge=0.0, le=1.0)
    mean_force_low: float = Field(ge=0.0)
    mean_force_high: float = Field(ge=0.0)
    missing_cycles: int = Field(ge=0)
    agreement_share: float = Field(ge=0.0)
    mismatches: int = Field(ge=0)
    fallbacks: int = Field(ge=0)
    standard: str
    standard_file: str
    standard_binding: list[str]


def read_limits(path: Path | str | None = None) -> Limits:
    """Read the limits that come with the package, overridden by those in the file at `path`.

    Raises
    ------
    LimitsError
        The file is missing, is no YAML, or has an unknown key or a value that is not allowed; one line.
    """
    values: dict[str, Any] = {}
    for file in (config_file("energy_monitor", "report_limits.yaml"), *([Path(path)] if path else [])):
        try:
            tree = read_yaml(file)
        except YamlError as error:
            raise LimitsError(str(error)) from None
        if not isinstance(tree, dict):
            raise LimitsError(f"{file}: has to be a mapping")
        values |= tree
        try:
            limits = Limits.model_validate(values)
        except ValidationError as error:
            first = error.errors()[0]
            where = ".".join(str(part) for part in first["loc"])
            raise LimitsError(f"{file}: '{where}' = {first['input']!r}: {first['msg']}") from None
    return limits


def judge(
    limits: Limits,
    speed: float,
    aligned: Aligned,
    tracking: Tracking,
    force: ContactForce,
    conservation: Conservation,
    books: Sequence[Agreement],
    quality: Sequence[Agreement],
    retracted: int,
    mismatches: int,
    fallbacks: int,
    bridged: int,
    uplift_force: float | None = None,
    beyond_run_in: bool = True,
) -> list[Verdict]:
    """Hold the results of a ride at `speed` (m/s) against the limits.

    `retracted`, `mismatches`, `fallbacks` and `bridged` count cycles. `uplift_force` in N is None where the ride's
    parameters are not known. What a ride is like in its run-in is not judged: if there is nothing
    `beyond_run_in`, position, energy and force are open.

    Raises
    ------
    LimitsError
        The table of contact-force limits cannot be read or lacks the standard that is asked for.
    """
    verdicts = [
        _at_most(
            "position", "Position error, rms", tracking.position_error_rms * 1e3, limits.position_error_rms * 1e3, "mm"
        ),
        _share(
            "energy", "Energy error |dE|, of exchanged", conservation.delta_e_max_share, limits.energy_error_share,
            "largest |dE| of the ride over the exchanged energy, eq. (3.46)",
        ),
        _share(
            "work", "The same by accumulated work", conservation.delta_work_max_share, limits.work_error_share,
            "largest difference of the work done on rig and catenary over the exchanged energy",
        ),
        _share(
            "momentum", "Momentum error |dp|, of exchanged", conservation.delta_p_max_share,
            limits.momentum_error_share, "largest |dp| of the ride over the exchanged momentum, eq. (3.47)",
        ),
        _share(
            "impulse", "The same by accumulated impulse", conservation.delta_impulse_max_share,
            limits.impulse_error_share,
            "largest difference of the impulse given to rig and catenary over the exchanged momentum",
        ),
        _mean_force(limits, force, uplift_force),
        _at_most(
            "contact", "Time without contact", force.loss_share * 100.0, limits.loss_share * 100.0, "%", _losses(force)
        ),
        _at_most("cycles", "Missing cycles", float(len(aligned.missing)), float(limits.missing_cycles), ""),
        Verdict("ended", "Ride came to its last cycle", float(aligned.ended), 1.0, None, TRUTH, aligned.ended),
        _at_most("retracted", "Cycles with the rig retracted", float(retracted), 0.0, ""),
        _at_most(
            "mismatches", "Cycles with another force than was sent", float(mismatches), float(limits.mismatches), "",
            "F_tr from rig to controller, F_cat = prediction + F_cor, F_cat from controller to catenary, eq. (3.45)",
        ),
        _at_most("fallbacks", "Cycles answered by the shifted plan", float(fallbacks), float(limits.fallbacks), ""),
        replace(
            _at_most("bridged", "Cycles bridged or held without a command", float(bridged), 0.0, ""), binding=False
        ),
    ]  # fmt: skip
    verdicts += _standard(limits, speed, force)
    if not beyond_run_in:
        steady = {"position", "energy", "work", "momentum", "impulse", "mean_force", "contact"}
        verdicts = [
            replace(verdict, ok=None, source=_RUN_IN_ONLY)
            if verdict.key in steady or verdict.key.startswith(f"{limits.standard or STANDARD}_")
            else verdict
            for verdict in verdicts
        ]
    whole = not aligned.missing  # with gaps the sums differ by what is not in the bag
    known = {entry.source: entry for entry in books}
    subjects: list[tuple[str, str, str, Agreement | None]] = [
        ("monitor_books", "Monitor's books are off by", _OF_EXCHANGED, known.get("energy_monitor")),
        ("controller_books", "Controller's books are off by", _OF_EXCHANGED, known.get("impedance_mpc")),
        ("monitor_force", "Monitor's force figures are off by", "over the mean force", next(iter(quality), None)),
    ]
    found = [_agreement(key, name, source, entry, limits, whole) for key, name, source, entry in subjects]
    if uplift_force is not None:
        # A ride whose parameters are known had both nodes: without their books it was not audited.
        found = [
            replace(verdict, ok=False, source="the ride was not audited: not in the bag")
            if entry is None and verdict.key.endswith("_books")
            else verdict
            for verdict, (_, _, _, entry) in zip(found, subjects, strict=True)
        ]
    return verdicts + found


def _at_most(key: str, name: str, value: float | None, limit: float, unit: str, source: str = "") -> Verdict:
    return Verdict(key, name, value, None, limit, unit, None if value is None else value <= limit, source=source)


def _losses(force: ContactForce) -> str:
    """Say which losses count."""
    if force.loss_duration <= 0.0:
        return "every sample at or below the threshold counts (contact.loss_duration 0)"
    left_out = f"{force.shorter_losses} shorter ones are left out (contact.loss_duration)"
    return f"losses of at least {force.loss_duration * 1e3:g} ms; {left_out}"


def _share(key: str, name: str, value: float | None, limit: float, source: str) -> Verdict:
    """Judge a share (1) in per cent."""
    return _at_most(key, name, None if value is None else value * 100.0, limit * 100.0, "%", source)


def _mean_force(limits: Limits, force: ContactForce, uplift_force: float | None) -> Verdict:
    low, high = limits.mean_force_low, limits.mean_force_high
    verdict = Verdict("mean_force", "Mean contact force, of the uplift force", None, low, high, "", None)
    if uplift_force is None or uplift_force <= 0.0:
        return replace(verdict, source="the ride's parameter test_rig_sim.uplift_force is not known")
    value = force.mean / uplift_force
    source = f"Fm over test_rig_sim.uplift_force = {uplift_force:g} N"
    return replace(verdict, value=value, ok=low <= value <= high, source=source)


def _agreement(key: str, name: str, source: str, agreement: Agreement | None, limits: Limits, whole: bool) -> Verdict:
    high = limits.agreement_share
    if agreement is None:
        return Verdict(key, name, None, None, high, "", None, source="not in the bag, or not comparable")
    if not whole:
        return Verdict(key, name, agreement.share, None, high, "", None, source="cycles are missing")
    return Verdict(key, name, agreement.share, None, high, "", agreement.share <= high, source=source)


def _standard(limits: Limits, speed: float, force: ContactForce) -> list[Verdict]:
    tables = contact_limits.load(limits.standard_file or None)
    name = limits.standard or STANDARD
    if name not in tables:
        raise LimitsError(f"no standard '{name}' among the limits: {', '.join(tables)}")
    statistics = ContactStatistics(
        force.samples, force.mean, force.sigma, force.minimum, force.maximum, force.loss_share, force.losses
    )
    found = []
    # Rounded, for 250 km/h must not be a hair above 250 only because m/s are stored.
    for check in contact_limits.evaluate(tables[name], statistics, round(speed * 3.6, 6)):
        scale, unit = (100.0, "%") if check.quantity == "loss_share" else (1.0, check.unit)
        low, high = (None if side is None else side * scale for side in (check.low, check.high))
        found.append(
            Verdict(
                key=f"{name}_{check.quantity}",
                name=check.name[0].upper() + check.name[1:],
                value=check.value * scale,
                low=low,
                high=high,
                unit=unit,
                ok=check.ok,
                binding=check.quantity in limits.standard_binding,
                source=check.source,
            )
        )
    return found
