"""Receivers with a level only, such as beacon receivers, for step track."""
