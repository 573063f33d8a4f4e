"""Messages as numbers: CDR, records, and the commands of a node."""
