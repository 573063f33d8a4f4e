"""Reprocess a recording: recompute a node, replay the recording into live nodes, rerun the whole run."""
