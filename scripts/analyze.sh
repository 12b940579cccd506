#!/usr/bin/env bash
# Makes the report of a recorded ride. All options: --help.
set -u
. "$(dirname "${BASH_SOURCE[0]}")/lib/environment.sh"
phil_help energy_monitor.report.cli "$@"
phil_environment run
exec python -m energy_monitor.report.cli "$@"
