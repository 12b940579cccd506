#!/usr/bin/env bash
# Sets up, builds and runs all checks: ruff, mypy, pytest. Arguments go to pytest (e.g. -k equilibrium, -m 'not integration').
set -u
if [ "${1:-}" = --help ] || [ "${1:-}" = -h ]; then
  cat <<'HELP'
usage: scripts/test.sh [--fast | pytest arguments]
Sets up a virtual environment, builds the workspace, runs ruff, mypy and pytest: first what starts no nodes, with a worker
for each core (up to four); then what starts nodes, two rides at a time; then what keeps to the wall clock, alone.
    --fast                                   ruff, and the tests that are neither slow nor start nodes; no mypy
With other arguments only pytest is run, with these arguments (and one worker unless they say -n):
    scripts/test.sh -m "not integration"     without the tests that start the nodes
    scripts/test.sh -m slow                  the long ones: studies, laws over many examples, whole reports
    scripts/test.sh catenary_model/test      one package
    scripts/test.sh --hypothesis-profile=explore   property tests with new examples, not the same ones each time
HELP
  exit 0
fi
. "$(dirname "${BASH_SOURCE[0]}")/lib/environment.sh"
phil_environment test
cd "$PHIL_ROOT" || exit 3
status=0
workers=(-n auto --maxprocesses 4)
case "$#,${1:-}" in
  0,)
    echo "== ruff" && ruff check . && ruff format --check . || status=1
    echo "== mypy" && mypy || status=1
    echo "== pytest"
    python -m pytest "${workers[@]}" --dist loadfile -m "not integration" || status=1
    # Each worker has ROS domains of its own, and rides once for all tests of a file. Rides in lockstep wait for each other
    # when there are more of them than cores.
    python -m pytest -n 2 --dist loadfile -m "integration and not alone" || status=1
    python -m pytest -m "integration and alone" || status=1
    ;;
  1,--fast)
    echo "== ruff" && ruff check . && ruff format --check . || status=1
    echo "== pytest"
    python -m pytest "${workers[@]}" --dist worksteal -m "not integration and not slow" || status=1
    ;;
  *)
    echo "== pytest"
    python -m pytest "$@" || status=1
    ;;
esac
exit "$status"
