"""The table of the methods of acceptance, by subject."""
from pedestal_workbench.acceptance import margins, safety, servo, tracking
from pedestal_workbench.acceptance.method import Method

METHODS: tuple[Method, ...] = (*servo.METHODS, *margins.METHODS, *tracking.METHODS, *safety.METHODS)
METHOD_BY_NAME = {method.name: method for method in METHODS}
