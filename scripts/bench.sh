#!/usr/bin/env bash
# Measures how long things take here: scripts/bench.sh catenary | lines | mpc | realtime | rides. All options: --help.
set -u
. "$(dirname "${BASH_SOURCE[0]}")/lib/environment.sh"
phil_help bench "$@"
phil_environment run
for argument in "$@"; do
  [ "$argument" = mpc ] && phil_optional bench # the solvers that the controller's is compared with
done
exec python -m bench "$@"
