"""Verbs for a recording: verify, recover, report, export, rerun, recompute, replay."""
