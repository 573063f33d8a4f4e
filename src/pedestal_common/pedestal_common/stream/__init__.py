"""Data that arrive one after another: bytes of a connection, samples with a latency, and what is dropped of them."""
