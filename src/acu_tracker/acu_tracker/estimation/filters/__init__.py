"""The target filters; `target_filter` is the interface for `estimation`."""
