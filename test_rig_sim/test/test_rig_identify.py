"""Identification: exact discretisation of the delayed PT2, recovery of known loops, the files that are shipped."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from phil_base.parameters import read_file
from test_rig_sim.identify import identify, main, parameter_file, pt2_matrices, pt2_response, simulate_pt2

ROOT = Path(__file__).parents[2]
IDENTIFIED = ROOT / "impedance_mpc" / "impedance_mpc" / "config" / "identified"


@pytest.mark.parametrize("delay", [0.0, 0.0007, 0.002, 0.0053])
def test_matrices_are_the_exact_answer_to_a_delayed_ramp(delay: float) -> None:
    # Against an integration of the differential equation with the interpolated, delayed reference.
    u, omega = np.array([0.0, 0.0, 0.0, 0.0, 0.3, -0.2, 0.5, 0.1, 0.1, 0.4]), 2.0 * math.pi * 40.0
    time = 0.002 * np.arange(u.size)

    def rate(t: float, x: np.ndarray) -> list[float]:
        return [x[1], omega**2 * (float(np.interp(t - delay, time, u)) - x[0]) - 1.6 * omega * x[1]]

    solution = solve_ivp(rate, (0.0, time[-1]), [0.0, 0.0], t_eval=time, rtol=1e-10, atol=1e-13, max_step=1e-5)
    model = simulate_pt2(40.0, 0.8, 0.002, u, delay)
    assert model == pytest.approx(solution.y.T, abs=1e-6 * 100.0)
    assert model[:, 0] == pytest.approx(solution.y[0], abs=1e-6)


def test_pt2_matrices_hold_a_ramp_exactly() -> None:
    # A PT2 with dead time follows a ramp at the distance 2 zeta / omega + delay times its slope.
    delay = 0.0031
    a, b = pt2_matrices(40.0, 0.8, 0.002, delay)
    behind = 1.6 / (2.0 * math.pi * 40.0) + delay
    u = 0.002 * (1.0 - np.arange(b.shape[1]))
    assert b.shape == (2, 4)
    assert a @ np.array([-behind, 1.0]) + b @ u == pytest.approx([0.002 - behind, 1.0], abs=1e-12)


def test_response_is_the_gain_of_the_simulation() -> None:
    f, t = 12.5, 0.002 * np.arange(2000)
    w = simulate_pt2(35.0, 0.75, 0.002, np.sin(2.0 * math.pi * f * t), 0.0013)[:, 0]
    found = 2j * (w * np.exp(-2j * math.pi * f * t))[-800:].mean()
    assert found == pytest.approx(pt2_response(35.0, 0.75, 0.002, np.array([f]), 0.0013)[0], abs=1e-9)


def test_linear_rig_is_a_pt2(rig_parameters: Any, perfect: dict[str, Any]) -> None:
    # Nothing but the sampling at 5 kHz separates the loop from a PT2: 0.1 %.
    found, _, _ = identify(rig_parameters(perfect))
    assert (found.natural_frequency_hz, found.damping) == pytest.approx((40.0, 0.8), rel=0.01)
    assert found.gain == pytest.approx(1.0, abs=1e-4)
    assert found.delay < 2e-5
    assert found.residual < 1e-4
    assert found.velocity_residual < 1e-3


@pytest.mark.parametrize("steps", [1, 5, 12])
@pytest.mark.slow
def test_delay_of_the_rig_is_found(rig_parameters: Any, perfect: dict[str, Any], steps: int) -> None:
    # Whole inner steps of actuation delay, above 10 more than a cycle, are the dead time that comes out.
    changes = {**perfect, "imperfections.delay": True, "drive.delay": steps}
    found, _, _ = identify(rig_parameters(changes))
    assert found.delay == pytest.approx(steps * 2e-4, abs=2e-5)
    assert (found.natural_frequency_hz, found.damping) == pytest.approx((40.0, 0.8), rel=0.01)


def test_whole_cycles_of_command_delay_are_dead_time(rig_parameters: Any) -> None:
    now, _, _ = identify(rig_parameters())
    late, _, _ = identify(rig_parameters({"command_delay": 2}))
    assert late.delay - now.delay == pytest.approx(0.004, abs=2e-5)
    assert late.natural_frequency_hz == pytest.approx(now.natural_frequency_hz, rel=5e-3)


@pytest.mark.parametrize(
    ("name", "position", "velocity"), [("ideal", 1e-4, 1e-3), ("nominal", 0.005, 0.02), ("harsh", 0.02, 0.1)]
)
def test_shipped_files_are_what_the_identification_finds(
    rig_named: Any, name: str, position: float, velocity: float
) -> None:
    # To the digits of the file: everything is seeded. 1e-6 leaves room for other mathematical libraries.
    parameters = rig_named(name)
    found, _, _ = identify(parameters)
    shipped = read_file(IDENTIFIED / f"{name}.yaml")["impedance_mpc"]
    assert found.natural_frequency_hz == pytest.approx(shipped["rig_natural_frequency_hz"], rel=1e-3)
    assert found.damping == pytest.approx(shipped["rig_damping_ratio"], rel=1e-3)
    assert found.delay == pytest.approx(shipped["rig_delay"], abs=5e-6)
    assert found.residual < position
    assert found.velocity_residual < velocity


def test_the_controller_s_default_is_the_nominal_rig() -> None:
    wanted = read_file(IDENTIFIED / "nominal.yaml")["impedance_mpc"]
    defaults = read_file(ROOT / "impedance_mpc" / "impedance_mpc" / "config" / "impedance_mpc.yaml")["impedance_mpc"]
    assert {key: defaults[key] for key in wanted} == wanted


def test_command_writes_a_parameter_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "mine.yaml"
    rig = ROOT / "test_rig_sim" / "test_rig_sim" / "config" / "rigs" / "ideal.yaml"
    assert main([str(rig), "--out", str(out)]) == 0
    assert out.read_text() == capsys.readouterr().out
    assert "Rig: ideal" in out.read_text()
    assert read_file(out)["impedance_mpc"]["rig_natural_frequency_hz"] == pytest.approx(40.0, rel=0.01)


def test_command_names_a_wrong_parameter(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    wrong = tmp_path / "wrong.yaml"
    wrong.write_text("test_rig_sim: {ros__parameters: {drive: {mass: -1.0}}}")
    with pytest.raises(SystemExit) as ended:
        main([str(wrong)])
    assert ended.value.code == 2
    assert "drive.mass" in capsys.readouterr().err


def test_command_names_a_place_that_cannot_be_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "absent" / "mine.yaml"
    with pytest.raises(SystemExit) as ended:
        main(["--out", str(out)])
    assert ended.value.code == 2
    assert f"--out {out} cannot be written: No such file or directory" in capsys.readouterr().err


def test_file_tells_the_matrices(rig_parameters: Any, perfect: dict[str, Any]) -> None:
    found, _, _ = identify(rig_parameters(perfect))
    a, _ = pt2_matrices(found.natural_frequency_hz, found.damping, 0.002, found.delay)
    assert f"A_tr = [[{a[0, 0]:.6g}, {a[0, 1]:.6g}]" in parameter_file(found, 0.002, "one")
