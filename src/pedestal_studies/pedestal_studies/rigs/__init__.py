"""Test rigs of the studies: one law or one small loop, many times, without the rest of the antenna."""
