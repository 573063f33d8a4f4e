"""The verbs of `pedestal`, one a file: its arguments and its main."""
