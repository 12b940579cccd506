"""Parameters that are set while a node lives: by `ros2 param set` and `ros2 param load`, which rclpy's client is."""

from importlib import import_module

import pytest
import rclpy
from rcl_interfaces.srv import SetParameters
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient

from phil_base.parameters import nest, values_of
from phil_base.yaml_file import dump_yaml
from phil_node.base import PhilNode
from phil_node.changes import UnknownParameterError
from ride.settings import resolve


@pytest.fixture(scope="module")
def ros():
    rclpy.init()
    yield
    rclpy.shutdown()


@pytest.fixture
def talk(ros):
    """Nodes by name, and a function that waits for an answer."""
    executor = SingleThreadedExecutor()
    made = {}

    def node(name):
        if name not in made:
            made[name] = PhilNode(name, import_module(f"{name}.parameters").Parameters)
            executor.add_node(made[name])
        return made[name]

    client = Node("client")
    executor.add_node(client)

    def answer(future):
        executor.spin_until_future_complete(future, timeout_sec=10.0)
        return future.result()

    yield node, client, answer
    executor.shutdown()
    for each in (*made.values(), client):
        each.destroy_node()


def ask(talk, name, key, value):
    node, client, answer = talk
    node(name)
    remote = AsyncParameterClient(client, name)
    assert remote.wait_for_services(10.0)
    result = answer(remote.set_parameters([Parameter(key, value=value)]))
    assert isinstance(result, SetParameters.Response)
    return result.results[0]


def test_a_misspelt_name_is_answered_with_the_name_that_is_meant(talk):
    found = ask(talk, "impedance_mpc", "weigths.position", 2.0)
    assert not found.successful
    assert found.reason == "impedance_mpc has no parameter 'weigths.position'; did you mean 'weights.position'?"
    with pytest.raises(UnknownParameterError, match=r"weigths\.position"):
        talk[0]("impedance_mpc").set_parameters([Parameter("weigths.position", value=2.0)])


@pytest.mark.parametrize(("value", "taken"), [(2, 2.0), ("2e-06", 2e-6), (0.5, 0.5)])
def test_a_number_is_a_number_whatever_it_came_as(talk, value, taken):
    assert ask(talk, "impedance_mpc", "weights.position", value).successful
    assert talk[0]("impedance_mpc").parameters.weights.position == taken


@pytest.mark.parametrize("value", ["1:30", "yes", "fast", True, "nan"])
def test_what_is_no_number_is_refused(talk, value):
    assert not ask(talk, "impedance_mpc", "weights.position", value).successful


def test_only_live_parameters_change_while_active(talk):
    node = talk[0]("energy_monitor")
    node.active = True
    for key, value in (("use_sim_time", True), ("window", 100)):
        found = ask(talk, "energy_monitor", key, value)
        assert not found.successful
        assert found.reason == f"'{key}' cannot change while active: deactivate energy_monitor first"
    assert not node.get_parameter("use_sim_time").value
    assert ask(talk, "energy_monitor", "tolerance.energy", 0.5).successful
    node.active = False
    assert ask(talk, "energy_monitor", "use_sim_time", True).successful


@pytest.mark.parametrize("name", ["impedance_mpc", "energy_monitor"])
def test_the_parameters_of_a_ride_can_be_loaded_into_its_nodes(talk, tmp_path, name):
    """Rclpy's client makes a text of 1.0e-06: it reads the number by YAML 1.1, and its str() once more."""
    node, client, answer = talk
    wanted = resolve(None, {"energy_monitor": {"tolerance.relative": 1e-7}})[name]
    file = tmp_path / "params.yaml"
    file.write_text(dump_yaml({name: {"ros__parameters": nest(wanted)}}))
    node(name)
    remote = AsyncParameterClient(client, name)
    assert remote.wait_for_services(10.0)
    found = answer(remote.load_parameter_file(str(file)))
    assert [result.reason for result in found.results if not result.successful] == []
    assert values_of(node(name).parameters) == wanted
