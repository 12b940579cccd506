"""The report of a ride: numbers recomputed from its bag, verdicts, figures, and pages to read them on.

`write_report` makes all of it, `summary_table` prints it. They are loaded on first use, for matplotlib takes a while.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from energy_monitor.report.results import Report
    from energy_monitor.report.table import summary_table
    from energy_monitor.report.write import ReportError, write_report

__all__ = ["Report", "ReportError", "summary_table", "write_report"]

_HOME = {"Report": "results", "ReportError": "write", "summary_table": "table", "write_report": "write"}


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
