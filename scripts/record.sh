#!/usr/bin/env bash
# Records a running ride into an MCAP bag. All options: --help.
set -u
. "$(dirname "${BASH_SOURCE[0]}")/lib/environment.sh"
phil_help energy_monitor.record "$@"
phil_environment run
exec python -m energy_monitor.record "$@"
