"""Test rigs of the studies: one law or one small loop, run many times, without the rest of the antenna."""
