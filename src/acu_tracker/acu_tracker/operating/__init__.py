"""What an operator may command, who holds control, and what the control unit reports."""
