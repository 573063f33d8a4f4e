"""Messages as numbers: CDR, records, and the commands that a node takes."""
