"""Reprocess a recording: recompute a node, or rerun the whole run; and replay a recording into live nodes."""
