"""The controlled layer: its design step by step, its reflection, its stability, its cache."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from catenary_model.boundary import AHEAD, BEHIND, BOUNDARIES, Feedback, Layer, impose
from catenary_model.boundary.control_design import cache, end_gain, wire_gains
from catenary_model.boundary.control_design.design import check
from catenary_model.boundary.control_design.dispersion import travelling
from catenary_model.boundary.control_design.modal import cosines_and_sines, modal_gain
from catenary_model.boundary.control_design.reference import damping_profile, trajectory
from catenary_model.boundary.controlled import DISCRETISED
from catenary_model.boundary.reflection import reflection
from catenary_model.boundary.springs import Spring, frozen
from catenary_model.boundary.stability import Stepper, growth_per_period, spectral_radius
from catenary_model.line import CARRIER_3_1, CONTACT_3_1, Line
from catenary_model.moving_frame import CARRIER, CONTACT, Mesh, MovingFrame, assemble
from phil_base.cache import digest

FAST = 320.0 / 3.6
BAND = np.arange(0.5, 30.1, 0.5)


@pytest.fixture(autouse=True)
def _own_cache(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PHIL_CACHE", str(tmp_path_factory.getbasetemp() / "designs"))


def frame(speed: float, h: float = 1.0, half: int = 40) -> MovingFrame:
    return assemble(Mesh(h, half), CARRIER_3_1, CONTACT_3_1, speed)


def share(kind: str, speed: float, wire: int, end: int, nodes: int, frequency: np.ndarray) -> np.ndarray:
    """Reflected amplitude over that of a clamped end in the place of the layer."""
    layer = Layer(nodes=nodes)
    ended, held = frame(speed), frame(speed)
    feedback = impose(kind, ended, layer)
    impose("clamped", held, replace(layer, nodes=0))
    whole = reflection(held, None, wire, end, replace(layer, nodes=0), frequency)
    return np.abs(reflection(ended, feedback, wire, end, layer, frequency) / whole)


@pytest.mark.parametrize("end", [BEHIND, AHEAD])
def test_fit_and_shift_foretell_a_harmonic(end: int) -> None:
    """(3.32) to (3.35) of a wave that leaves, any phase, undamped profile: the next steps to 1e-6."""
    step, nodes, horizon = Layer(), 20, 5
    harmonics = travelling("discretised", CONTACT_3_1, 1.0, FAST, end, nodes, np.array([2.0, 7.0, 16.0, 28.0]), step)
    L = cosines_and_sines(harmonics.state[: 2 * nodes])
    K_mod = modal_gain(L, np.ones(2 * nodes), np.ones(8), 1e-10)
    amplitude = np.array([0.3 - 0.1j, -0.2j, 1.0, 0.05 + 0.4j])
    T = trajectory(harmonics, damping_profile(nodes, nodes, 0.0, 2.0), horizon)
    foretold = T @ K_mod @ (harmonics.field @ amplitude).real
    for ahead in range(1, horizon + 1):
        true = (harmonics.field @ (amplitude * harmonics.shift**ahead)).real
        assert foretold[ahead - 1] == pytest.approx(true, abs=1e-6)


def test_damping_profile_is_nothing_inside_and_grows_outwards() -> None:
    profile = damping_profile(8, 4, 1.5, 2.0)
    assert profile[0] == pytest.approx(np.exp(-1.5))
    assert np.all(profile[8:] == 1.0)
    assert np.all(np.diff(profile[:10:2]) > 0.0)
    assert np.array_equal(profile[0::2], profile[1::2])


@pytest.mark.parametrize("speed", [0.0, 250.0 / 3.6, FAST])
@pytest.mark.slow
def test_controlled_reflects_little_on_both_sides_of_both_wires(speed: float) -> None:
    """At most 0.5 % rms and 1 % anywhere to 30 Hz, four times better than the dashpot; 31 to 60 Hz at most 20 %."""
    above = np.arange(31.0, 61.0, 1.0)
    for wire in (CARRIER, CONTACT):
        for end in (BEHIND, AHEAD):
            R = share("controlled", speed, wire, end, 20, BAND)
            plain = share("matched_dashpot", speed, wire, end, 0, BAND)
            rms = np.sqrt(np.mean(R**2))
            assert rms < 0.005
            assert np.max(R) < 0.01
            assert 4.0 * rms < np.sqrt(np.mean(plain**2))
            assert np.max(share("controlled", speed, wire, end, 20, above)) < 0.2


def test_discretised_relation_beats_the_continuous_one_where_the_mesh_is_coarse() -> None:
    """1 m elements, waves ahead at 320 km/h: at least five times, each design with its own settings."""
    of = {kind: share(kind, FAST, CONTACT, AHEAD, 20, BAND) for kind in ("controlled", "controlled_continuous")}
    rms = {kind: np.sqrt(np.mean(R**2)) for kind, R in of.items()}
    assert 5.0 * rms["controlled"] < rms["controlled_continuous"]


def test_an_end_is_designed_for_its_direction_and_at_rest_both_are_alike() -> None:
    layer = Layer()
    behind, ahead = wire_gains(CONTACT_3_1, 1.0, 0.0, layer, DISCRETISED)
    # mirrored: rotations and torques change sign
    sign = np.where(np.arange(behind.shape[1]) % 2, -1.0, 1.0)
    mirrored = sign[: behind.shape[0], None] * ahead * sign
    assert mirrored == pytest.approx(behind, rel=1e-6, abs=1e-6 * np.abs(behind).max())
    behind, ahead = wire_gains(CONTACT_3_1, 1.0, FAST, layer, DISCRETISED)
    mirrored = sign[: behind.shape[0], None] * ahead * sign
    assert np.abs(mirrored - behind).max() > 0.1 * np.abs(behind).max()


def test_an_unstable_gain_is_refused() -> None:
    """A gain that drives the end node with its own velocity undoes the dashpot; the message tells the radius."""
    gains = wire_gains(CONTACT_3_1, 1.0, FAST, Layer(), DISCRETISED)
    assert check(CONTACT_3_1, 1.0, FAST, Layer(), gains) < 1.0
    driven = gains[AHEAD].copy()
    driven[0, driven.shape[1] // 3] += 3.0 * CONTACT_3_1.mass_per_length * CONTACT_3_1.wave_speed
    with pytest.raises(ValueError, match=r"spectral radius [1-9]\.\d+ of the closed loop"):
        check(CONTACT_3_1, 1.0, FAST, Layer(), (gains[BEHIND], driven))


def test_an_unstable_design_does_not_come_out_of_the_registry_nor_into_the_cache() -> None:
    greedy = replace(DISCRETISED, dispersion="continuous", regularisation=1e-14, effort=1e-9, others=0.0)
    before = sorted(cache.folder().glob("*"))
    with pytest.raises(ValueError, match="refused: spectral radius"):
        wire_gains(CONTACT_3_1, 1.0, FAST, Layer(), greedy)
    assert sorted(cache.folder().glob("*")) == before


@pytest.mark.parametrize("speed", [0.0, 250.0 / 3.6, FAST])
@pytest.mark.slow
def test_coupled_wires_with_frozen_droppers_are_stable(speed: float) -> None:
    layer, domain = Layer(), frame(speed, half=50)
    feedback = impose("controlled", domain, layer)
    for zeta in (0.0, 7.0, 30.0):
        assert spectral_radius(domain, feedback, layer, frozen(Line(), domain.mesh, zeta, 40.0)) < 1.0


@pytest.mark.slow
def test_motion_decays_while_the_line_passes() -> None:
    layer, domain = Layer(), frame(250.0 / 3.6, half=35)
    feedback = impose("controlled", domain, layer)
    assert growth_per_period(domain, feedback, layer, Line(), 30.0, periods=2) < 1.0
    with pytest.raises(ValueError, match="at rest"):
        growth_per_period(frame(0.0), None, layer, Line(), 30.0)


def test_nothing_is_lost_between_clamped_ends_and_the_radius_says_so() -> None:
    """Lossless wires, Newmark 0.25/0.5, springs between them: radius 1 to 1e-7; and Stepper keeps the motion."""
    lossless = [replace(wire, damping=0.0) for wire in (CARRIER_3_1, CONTACT_3_1)]
    held, layer = assemble(Mesh(1.0, 8), *lossless, 0.0), Layer(nodes=0, beta=0.25, gamma=0.5)
    impose("clamped", held, layer)
    springs = [Spring(0.3, 1e5, 1.0, -1.0), Spring(-3.0, 1e5, 1.0, 0.0)]
    assert spectral_radius(held, None, layer, springs) == pytest.approx(1.0, abs=1e-7)


@pytest.mark.slow
def test_stepper_and_radius_are_the_same_system() -> None:
    """Power iteration of the step with feedback and springs approaches the dense radius, 1e-3."""
    layer, domain = Layer(nodes=8), frame(250.0 / 3.6, half=12)
    feedback = impose("controlled", domain, layer)
    springs = [Spring(0.3, 2e4, 1.0, -1.0), Spring(-3.0, 2e4, 1.0, 0.0)]
    stepper = Stepper(domain, feedback, layer)
    stepper.x[1] = np.random.default_rng(2).standard_normal(stepper.x[1].shape)
    sizes = []
    for _ in range(3000):
        stepper.step(springs)
        sizes.append(np.linalg.norm(stepper.x[1]))
    measured = (sizes[-1] / sizes[1499]) ** (1.0 / 1500.0)
    assert measured == pytest.approx(spectral_radius(domain, feedback, layer, springs), abs=1e-3)


def test_designs_are_kept_and_broken_files_made_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PHIL_CACHE", str(tmp_path / "new"))
    calls = []

    def compute() -> dict[str, np.ndarray]:
        calls.append(1)
        return {"a": np.arange(3.0) + len(calls)}

    first = cache.cached("test", {"h": 1.0, "kind": "x"}, compute)
    again = cache.cached("test", {"kind": "x", "h": 1.0}, compute)
    assert len(calls) == 1
    assert np.array_equal(first["a"], again["a"])
    assert list(again) == ["a"]
    cache.cached("test", {"h": 1.0 + 1e-15, "kind": "x"}, compute)
    assert len(calls) == 2
    (file,) = [f for f in cache.folder().glob("*.npz") if np.load(f)["a"][0] == 1.0]
    whole = file.read_bytes()
    for broken in (b"", whole[: len(whole) // 2], b"no archive", whole[:60] + b"\xff" + whole[61:]):
        file.write_bytes(broken)
        calls.clear()
        assert np.array_equal(cache.cached("test", {"h": 1.0, "kind": "x"}, compute)["a"], first["a"])
        assert len(calls) == 1
        assert file.read_bytes() != broken
    assert not list(cache.folder().glob("*.tmp"))


def test_a_design_of_other_sources_is_made_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PHIL_CACHE", str(tmp_path / "kept"))
    source = tmp_path / "design.py"
    source.write_text("EFFORT = 1\n")
    monkeypatch.setattr(cache, "SOURCES", (source,))

    def made(value: float) -> float:
        digest.cache_clear()  # as in another process
        return float(cache.cached("test", {"h": 1.0}, lambda: {"a": np.array(value)})["a"])

    assert (made(1.0), made(2.0)) == (1.0, 1.0)
    source.write_text("EFFORT = 2\n")
    assert (made(3.0), made(4.0)) == (3.0, 3.0)
    digest.cache_clear()


@pytest.mark.parametrize(("place", "byte"), [(6, 0xFF), (8, 0x01), (10, 0x63)])
def test_an_archive_that_asks_for_what_is_not_known_is_made_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, place: int, byte: int
) -> None:
    # In the archive's directory: a version, a password, a compression of another world.
    monkeypatch.setenv("PHIL_CACHE", str(tmp_path))
    first = cache.cached("test", {"h": 1.0}, lambda: {"a": np.ones(2)})
    (file,) = tmp_path.glob("*.npz")
    content = bytearray(file.read_bytes())
    at = content.index(b"PK\x01\x02")
    while at >= 0:
        content[at + place] = byte
        at = content.find(b"PK\x01\x02", at + 1)
    file.write_bytes(content)
    again = cache.cached("test", {"h": 1.0}, lambda: {"a": np.zeros(2)})
    assert (first["a"].sum(), again["a"].sum()) == (2.0, 0.0)


def test_without_a_home_nothing_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    def homeless() -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.delenv("PHIL_CACHE")
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr(Path, "home", homeless)
    assert cache.cached("test", {"h": 1.0}, lambda: {"a": np.ones(2)})["a"].sum() == 2.0


def test_a_folder_that_cannot_be_written_is_no_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("PHIL_CACHE", str(tmp_path / "file" / "below"))
    assert cache.cached("test", {"h": 1.0}, lambda: {"a": np.ones(2)})["a"].sum() == 2.0


def test_where_designs_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("PHIL_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", "/somewhere")
    assert cache.folder() == Path("/somewhere/phil-catenary")
    monkeypatch.delenv("XDG_CACHE_HOME")
    assert cache.folder() == Path.home() / ".cache/phil-catenary"


def test_a_cached_design_is_the_design() -> None:
    layer = Layer()
    designed = end_gain(CONTACT_3_1, 1.0, FAST, AHEAD, layer, DISCRETISED)
    for _ in range(2):
        assert np.array_equal(wire_gains(CONTACT_3_1, 1.0, FAST, layer, DISCRETISED)[AHEAD], designed)


def test_what_does_not_fit_is_named() -> None:
    with pytest.raises(ValueError, match=r"boundary = 'wall' is not one of .*controlled"):
        impose("wall", frame(0.0), Layer())
    with pytest.raises(ValueError, match="layers of 41 nodes"):
        impose("clamped", frame(0.0), Layer(nodes=41))
    with pytest.raises(ValueError, match="nodes"):
        impose("controlled", frame(0.0), Layer(nodes=0))
    with pytest.raises(ValueError, match="ts"):
        Layer(ts=0.0)
    with pytest.raises(ValueError, match="shape"):
        Feedback(((np.zeros((2, 7)),) * 2,) * 2)
    with pytest.raises(ValueError, match="moves"):
        replace(DISCRETISED, horizon=2, moves=3)
    with pytest.raises(ValueError, match="input_nodes"):
        replace(DISCRETISED, state_nodes=2, input_nodes=3)


@pytest.mark.parametrize("kind", list(BOUNDARIES))
def test_every_kind_takes_a_short_layer(kind: str) -> None:
    """A short layer is a worse one, never one that grows: radius below 1 on a lossy wire."""
    for nodes in (6, 12):
        domain, layer = frame(250.0 / 3.6, half=25), Layer(nodes=nodes)
        feedback = impose(kind, domain, layer)
        assert spectral_radius(domain, feedback, layer, wires=(CONTACT,)) < 1.0


@pytest.mark.parametrize("dx, ts, beta, gamma", [(0.5, 0.001, 0.28, 0.55), (1.25, 0.00222, 0.255, 0.525)])
@pytest.mark.parametrize("kmh", [80.0, 200.0, 350.0])
def test_a_design_is_found_for_other_speeds_meshes_and_steps(
    dx: float, ts: float, beta: float, gamma: float, kmh: float
) -> None:
    layer = Layer(ts=ts, beta=beta, gamma=gamma)
    gains = wire_gains(CARRIER_3_1, dx, kmh / 3.6, layer, DISCRETISED)
    assert check(CARRIER_3_1, dx, kmh / 3.6, layer, gains) < 1.0


def test_caution_finds_a_design_where_the_bold_one_is_unstable() -> None:
    """2 m elements at 350 km/h carry what runs ahead no more: the first design grows, the layer comes nevertheless."""
    step, wire, v = Layer(), CONTACT_3_1, 350.0 / 3.6
    bold = replace(DISCRETISED, highest=70.0, regularisation=1e-7, above=0.1, others=0.003, velocity=0.005)
    with pytest.raises(ValueError, match="refused"):
        check(wire, 2.0, v, step, tuple(end_gain(wire, 2.0, v, end, step, bold) for end in (BEHIND, AHEAD)))
    assert check(wire, 2.0, v, step, wire_gains(wire, 2.0, v, step, bold)) < 1.0
