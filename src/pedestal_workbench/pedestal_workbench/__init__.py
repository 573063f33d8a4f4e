"""Experiments on recordings and scenarios: recompute, rerun and replay, trials, tuning, calibration."""
