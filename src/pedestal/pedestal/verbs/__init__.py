"""The verbs of `pedestal`, one per file: its arguments and its main."""
