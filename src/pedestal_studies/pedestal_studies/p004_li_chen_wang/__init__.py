"""Paper 004: measured rate in the filter of a telemetry servo. The papers are in docs/papers.md."""
