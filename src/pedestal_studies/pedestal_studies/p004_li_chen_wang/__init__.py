"""Li 2018: measured rate in the filter of a telemetry servo. The papers are in docs/understand/papers.md."""
