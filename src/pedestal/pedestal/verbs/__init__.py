"""Verbs of `pedestal`, a module for each theme. Its table VERBS has a row (arguments, work) for each of its verbs."""
