"""Page of the operator: its server, its content, and the commands that it may send."""
