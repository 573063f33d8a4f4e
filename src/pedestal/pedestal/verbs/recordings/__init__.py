"""Verbs for a recording: verify, mend, report, export, and make it again."""
