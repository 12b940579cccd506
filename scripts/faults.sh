#!/usr/bin/env bash
# Does faults to a running ride in real time and judges the outcome: scripts/faults.sh [NAME ...]. All options: --help.
set -u
. "$(dirname "${BASH_SOURCE[0]}")/lib/environment.sh"
phil_help faults "$@"
phil_environment run
exec python -m faults "$@"
