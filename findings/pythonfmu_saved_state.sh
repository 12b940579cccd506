#!/usr/bin/env bash
# PythonFMU 0.7.0 with FMPy 0.3.32: an FMU that offers its state gives back only the part that is registered
#
# Built with --handle-state ("If given, canGetAndSetFMUstate=true"), an FMU tells every importer that fmi2GetFMUstate
# and fmi2SetFMUstate work; FMI 2.0 says of them that they copy and restore the internal state. What is saved are the
# values of the registered variables. An attribute of the model that is no FMI variable (a velocity, a counter, a
# filter's memory) keeps its value when the state is set back, all calls return fmi2OK, and a step that is repeated
# after a rollback gives another result. A master that iterates or adapts its step by rollback goes wrong without a
# sign. The caveat is in the discussion of the change that brought the flag (which is therefore not set without being
# asked for), not in the README or in the help of the builder; overriding _get_fmu_state and _set_fmu_state, or
# registering every attribute, avoids it.
#
#   oscillator with the registered output `position` and the plain attribute `velocity`, steps of 0.1 s
#
# Seen:
#   state saved at t = 0.5, then position at 0.6 ... 0.8    0.7969 0.7324 0.6605
#   state set back (position as saved), the same steps      0.7731 0.6850 0.5900
#   the same with `velocity` registered                     0.7969 0.7324 0.6605
set -eu
temp=$(mktemp -d)
trap 'rm -rf "$temp"' EXIT
"${PYTHON:-python3}" -m venv "$temp/venv" &&
    "$temp/venv/bin/pip" install -qq numpy==2.2.6 attrs==25.4.0 lark==1.3.1 lxml==6.0.2 msgpack==1.1.2 &&
    "$temp/venv/bin/pip" install -qq --no-deps pythonfmu==0.7.0 FMPy==0.3.32 || exit 2
cat >"$temp/oscillator.py" <<'PY'
from pythonfmu import Fmi2Causality, Fmi2Slave, Real


class Oscillator(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.position = 1.0
        self.velocity = 0.0
        self.register_variable(Real("position", causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        self.velocity -= step_size * self.position
        self.position += step_size * self.velocity
        return True
PY
sed -e 's/class Oscillator/class Registered/' \
    -e '/"position"/a\        self.register_variable(Real("velocity", causality=Fmi2Causality.local))' \
    "$temp/oscillator.py" >"$temp/registered.py"
for model in oscillator registered; do
    "$temp/venv/bin/python" -m pythonfmu build -f "$temp/$model.py" -d "$temp" --handle-state >/dev/null 2>&1
done
"$temp/venv/bin/python" - "$temp" <<'PY'
import sys
from pathlib import Path

from fmpy import extract, instantiate_fmu, read_model_description


def ride(name):
    """Saved and restored position, and three steps from there, before and after the rollback."""
    file = Path(sys.argv[1]) / f"{name}.fmu"
    description = read_model_description(str(file))
    assert description.coSimulation.canGetAndSetFMUstate
    fmu = instantiate_fmu(extract(str(file), unzipdir=str(file.with_suffix(""))), description, "CoSimulation")
    fmu.setupExperiment(startTime=0.0)
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    reference = [v.valueReference for v in description.modelVariables if v.name == "position"]

    def steps(first, last):
        positions = []
        for k in range(first, last):
            fmu.doStep(currentCommunicationPoint=k * 0.1, communicationStepSize=0.1)
            positions.append(round(fmu.getReal(reference)[0], 4))
        return positions

    steps(0, 5)
    saved = fmu.getReal(reference)[0]
    state = fmu.getFMUState()
    before = steps(5, 8)
    fmu.setFMUState(state)
    restored = fmu.getReal(reference)[0]
    after = steps(5, 8)
    fmu.freeFMUState(state)
    fmu.terminate()
    fmu.freeInstance()
    return saved == restored, before, after


hidden, registered = ride("Oscillator"), ride("Registered")
print("velocity not registered:", hidden)
print("velocity registered:    ", registered)
true = [0.7969, 0.7324, 0.6605]
sys.exit(0 if hidden == (True, true, [0.7731, 0.685, 0.59]) and registered == (True, true, true) else 1)
PY
