#!/usr/bin/env bash
# Rides for half an hour and looks whether anything grows, drifts or is lost. All options: --help.
set -u
. "$(dirname "${BASH_SOURCE[0]}")/lib/environment.sh"
phil_help soak "$@"
phil_environment run
exec python -m soak "$@"
