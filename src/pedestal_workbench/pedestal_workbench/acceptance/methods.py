"""The table of the methods of acceptance, by subject."""
from pedestal_workbench.acceptance import margins, servo
from pedestal_workbench.acceptance.method import Method

METHODS: tuple[Method, ...] = (*servo.METHODS, *margins.METHODS)
METHOD_BY_NAME = {method.name: method for method in METHODS}
