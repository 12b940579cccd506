#!/usr/bin/env bash
# Sets up, builds and runs all checks: ruff, mypy, pytest. Arguments go to pytest (e.g. -k equilibrium, -m 'not integration').
set -u
if [ "${1:-}" = --help ] || [ "${1:-}" = -h ]; then
  cat <<'HELP'
usage: scripts/test.sh [pytest arguments]
Sets up a virtual environment, builds the workspace, runs ruff, mypy and pytest: first what starts no nodes, with a worker
for each core (up to four), then what starts nodes.
With arguments only pytest is run, with these arguments (and one worker unless they say -n):
    scripts/test.sh -m "not integration"     without the tests that start the nodes
    scripts/test.sh catenary_model/test     one package
    scripts/test.sh --hypothesis-profile=explore   property tests with new examples, not the same ones each time
HELP
  exit 0
fi
. "$(dirname "${BASH_SOURCE[0]}")/lib/environment.sh"
phil_environment test
cd "$PHIL_ROOT" || exit 3
status=0
if [ "$#" -eq 0 ]; then
  echo "== ruff" && ruff check . && ruff format --check . || status=1
  echo "== mypy" && mypy || status=1
fi
echo "== pytest"
if [ "$#" -eq 0 ]; then
  # A worker for each core; then what starts nodes, alone: rides beside other work are slower and later than they should be.
  python -m pytest -n auto --maxprocesses 4 --dist loadfile -m "not integration" || status=1
  python -m pytest -m integration || status=1
else
  python -m pytest "$@" || status=1
fi
exit "$status"
