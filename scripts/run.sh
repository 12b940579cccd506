#!/usr/bin/env bash
# Emulates a ride: four nodes, a bag, a report. All options: --help.
set -u
. "$(dirname "${BASH_SOURCE[0]}")/lib/environment.sh"
phil_help ride "$@"
phil_environment run
exec python -m ride "$@"
