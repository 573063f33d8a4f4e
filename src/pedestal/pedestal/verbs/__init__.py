"""Verbs of `pedestal`, a module each with `add_arguments` and `main`."""
