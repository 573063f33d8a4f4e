"""The table of the methods of acceptance, by subject."""
from pedestal_workbench.acceptance.method import Method

METHODS: tuple[Method, ...] = ()
METHOD_BY_NAME = {method.name: method for method in METHODS}
