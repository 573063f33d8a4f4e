"""Where the axes are sent in each mode, and what an operator steers by hand."""
