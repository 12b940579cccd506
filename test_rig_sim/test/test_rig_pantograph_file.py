"""Pantograph files: what is read, and that what cannot be ridden is refused by file and key."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from phil_base.parameters import ParameterError
from test_rig_sim.pantographs.chain import chain
from test_rig_sim.pantographs.frame import Frame
from test_rig_sim.pantographs.linear_file import PantographFileError, read_pantograph
from test_rig_sim.pantographs.motion import states
from test_rig_sim.pantographs.options import STANDARD, Options
from test_rig_sim.rig import Rig

# One mass of 10 kg on 400 N/m and 30 N s/m, the actuator at the mass, the car body below.
ONE_MASS = {
    "kind": "transfer_function",
    "denominator": [10.0, 30.0, 400.0],
    "contact": [1.0],
    "lift": [1.0],
    "base": [30.0, 400.0],
}
MATRICES = {
    "kind": "state_space",
    "A": [[0.0, 1.0], [-40.0, -3.0]],
    "B": [[0.0, 0.0, 0.0], [-0.1, 40.0, 3.0]],
    "C": [1.0, 0.0],
    "inputs": ["contact_force", "base", "base_rate"],
}


def without(tree: dict[str, Any], key: str) -> dict[str, Any]:
    return {name: value for name, value in tree.items() if name != key}


def write(folder: Path, tree: object) -> Path:
    path = folder / "mine.yaml"
    path.write_text(tree if isinstance(tree, str) else yaml.safe_dump(tree))
    return path


def test_both_formats_give_the_same_ride(rig_parameters: Any, tmp_path: Path) -> None:
    def ride(tree: dict[str, Any]) -> list[float]:
        changes = {"pantograph": "state_space", "pantograph_file": str(write(tmp_path, tree)), "run_in": 0.1}
        rig = Rig(rig_parameters({**changes, "encoder_resolution": 0.0, "car_body.pitch_amplitude": 0.02}))
        found = []
        for _ in range(500):
            rig.advance(0.0, 0.0)
            found.append(rig.state.f_contact)
        return found

    first = ride(ONE_MASS)
    assert min(first) > 0.0
    assert first[-1] != pytest.approx(120.0, abs=0.5)  # the car body is felt
    # Rounding of 10000 steps; without 'lift' the lift acts where the contact force does, as in ONE_MASS.
    assert ride(MATRICES) == pytest.approx(first, abs=1e-8)
    assert ride(without(ONE_MASS, "lift")) == pytest.approx(first, abs=1e-8)


def test_a_frame_that_no_spring_holds_is_allowed(rig_parameters: Any, tmp_path: Path) -> None:
    # A pole at s = 0; the contact is what holds it. Static force: the lift, at every height.
    free = {"kind": "transfer_function", "denominator": [10.0, 30.0, 0.0], "contact": [1.0]}
    path = write(tmp_path, free)
    changes = {"load_cell.noise": 0.0, "contact.damping": 200.0}
    rig = Rig(rig_parameters({"pantograph": "state_space", "pantograph_file": str(path), **changes}))
    for k in range(3000):
        rig.advance(min(5e-5 * k, 0.1), min(5e-5 * (k + 1), 0.1))
    assert rig.state.f_contact == pytest.approx(120.0, abs=0.05)


def test_numbers_as_ros_writes_them_and_leading_zeros(tmp_path: Path) -> None:
    text = "kind: transfer_function\ndenominator: [0, 1e1, 3e1, 4e2]\ncontact: [0, 1]\n"
    assert states(read_pantograph(write(tmp_path, text))) == 2


@pytest.mark.parametrize(
    ("tree", "words"),
    [
        ("[1, 2", "no YAML"),
        ("just text", "mapping"),
        ({"kind": "magic"}, r"'kind' = 'magic'.*transfer_function, state_space"),
        ({}, r"'kind' = None"),
        (without(ONE_MASS, "contact"), "'contact' is missing"),
        ({**ONE_MASS, "mass": 3.0}, "'mass' is unknown"),
        ({**ONE_MASS, "denominator": [0.0, 0.0]}, "'denominator' must not be zero"),
        ({**ONE_MASS, "denominator": [1.0, 2.0]}, "'denominator' has degree 1"),
        ({**ONE_MASS, "denominator": "1 2 3"}, "'denominator' has to be a list"),
        ({**ONE_MASS, "denominator": [1.0, "x", 3.0]}, r"'denominator', entry 2 = 'x'"),
        ({**ONE_MASS, "denominator": [1.0, float("nan"), 3.0]}, r"'denominator', entry 2"),
        ({**ONE_MASS, "denominator": [10.0, True, 400.0]}, r"'denominator', entry 2 = True"),
        ({**ONE_MASS, "contact": [1.0, 1.0]}, "'contact' has degree 1, at most 0.*relative degree"),
        ({**ONE_MASS, "lift": [1.0, 1.0]}, "'lift' has degree 1, at most 0"),
        ({**ONE_MASS, "base": [1.0, 30.0, 400.0]}, "'base' has degree 2, at most 1"),
        ({**ONE_MASS, "contact": [-1.0]}, "'contact' must begin"),
        ({**ONE_MASS, "denominator": [10.0, -30.0, 400.0]}, r"not stable: pole at s = 1\.5"),
        ({**ONE_MASS, "denominator": [10.0, 0.0, 400.0]}, "not stable: pole"),
        ({**ONE_MASS, "denominator": [10.0, 0.0, 0.0]}, "not stable: more than one pole at s = 0"),
        ({**MATRICES, "C": [0.0, 1.0]}, "'B': C B = 0.*contact_force has -0.1"),
        ({**MATRICES, "C": [1.0, 0.0, 0.0]}, "'A' row 1 has 2 numbers, 3 are needed"),
        ({**MATRICES, "C": [1.0]}, "'C' has 1 numbers"),
        ({**MATRICES, "A": [[0.0, 1.0]]}, "'A' has 1 rows, 2 are needed"),
        ({**MATRICES, "A": 3.0}, "'A' has to be a list of rows"),
        ({**MATRICES, "B": [[0.0], [1.0]]}, "'B' row 1 has 1 numbers, 3 are needed"),
        ({**MATRICES, "B": [[0.0, 0.0, 0.0]]}, "'B' has 1 rows, 2 are needed"),
        ({**MATRICES, "inputs": ["contact_force", "wind", "base"]}, "'inputs' = .*wind.*base_rate"),
        ({**MATRICES, "inputs": ["contact_force", "base", "base"]}, "'inputs'.*each once"),
        ({**MATRICES, "inputs": [["contact_force"], "base", "base_rate"]}, "'inputs'"),
        ({**MATRICES, "inputs": ["lift", "base", "base_rate"]}, "'inputs' must contain contact_force"),
        ({**MATRICES, "B": [[0.0, 0.0, 0.0], [0.1, 40.0, 3.0]]}, "'B': contact_force must push the head down"),
        ({**MATRICES, "A": [[0.0, 1.0], [40.0, -3.0]]}, "not stable"),
        ({**MATRICES, "D": [0.0]}, "'D' is unknown"),
    ],
)
def test_unusable_files_are_named(tmp_path: Path, tree: object, words: str) -> None:
    with pytest.raises(PantographFileError, match=rf"mine\.yaml.*{words}"):
        read_pantograph(write(tmp_path, tree))


def test_a_missing_file_is_named_with_its_parameter(rig_parameters: Any, tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match=r"pantograph_file.*nowhere\.yaml.*cannot be read"):
        rig_parameters({"pantograph": "state_space", "pantograph_file": str(tmp_path / "nowhere.yaml")})
    # Nobody asks for the file of another pantograph.
    rig_parameters({"pantograph_file": str(tmp_path / "nowhere.yaml")})


@pytest.mark.parametrize(
    ("tree", "changes", "words"),
    [
        # A pole at -25000 1/s: too fast for steps of 0.1 ms.
        ({"denominator": np.polymul([10.0, 30.0, 400.0], [1.0, 2.5e4]).tolist()}, {}, "substeps = 4"),
        (without(ONE_MASS, "base"), {"car_body.bounce_amplitude": 0.01}, "'base'.*car_body moves"),
        # Compliance 1/(s + 1)^4: stable alone, unstable on a stiff contact.
        ({"denominator": np.poly([-1.0] * 4).tolist()}, {}, "in contact.*unstable"),
    ],
)
def test_what_the_rig_cannot_carry_is_refused(
    rig_parameters: Any, tmp_path: Path, tree: dict[str, Any], changes: dict[str, Any], words: str
) -> None:
    full = {"kind": "transfer_function", "contact": [1.0], **tree}
    path = write(tmp_path, full)
    with pytest.raises(ParameterError, match=rf"pantograph_file.*{words}"):
        rig_parameters({"pantograph": "state_space", "pantograph_file": str(path), **changes})


def test_the_examples_of_the_documentation_are_pantographs(tmp_path: Path) -> None:
    text = (Path(__file__).parents[2] / "docs" / "pantographs.md").read_text()
    files = re.findall(r"```yaml\n(.*?)```", text, re.S)
    assert [states(read_pantograph(write(tmp_path, file))) for file in files] == [4, 2]
    (code,) = re.findall(r"```python\n(.*?)```", text, re.S)
    names: dict[str, Any] = {"Options": Options, "STANDARD": STANDARD, "Frame": Frame, "chain": chain}
    exec(code.replace("-> Pantograph", ""), names)
    assert names["heavy_head"]().mass.tolist() == [15.0, 12.0]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("kind: transfer_function\ndenominator: [1.0, 1:30, 1.0]\ncontact: [1.0]\n", "'denominator', entry 2 = '1:30'"),
        ("kind: transfer_function\ndenominator: [1.0, 1_0, 1.0]\ncontact: [1.0]\n", "'denominator', entry 2 = '1_0'"),
        ("kind: transfer_function\ndenominator: [1.0, 2.0, 1.0]\ncontact: [1]\ncontact: [2]\n", "line 4: 'contact' is"),
    ],
)
def test_numbers_and_keys_are_those_of_yaml_1_2(tmp_path, text, words):
    path = tmp_path / "mine.yaml"
    path.write_text(text)
    with pytest.raises(PantographFileError, match=words):
        read_pantograph(path)


def test_a_coefficient_with_zeros_before_it_is_decimal(tmp_path):
    paths = [tmp_path / f"{i}.yaml" for i in range(2)]
    for path, number in zip(paths, ("010", "10.0"), strict=True):
        path.write_text(f"kind: transfer_function\ndenominator: [1, {number}, 25]\ncontact: [1e-2]\n")
    first, second = (read_pantograph(path) for path in paths)
    assert (first.A == second.A).all()
