"""Many runs at once, and the search for parameters that they serve."""
