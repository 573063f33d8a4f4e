"""Verb that simulates equipment, and the equipment of this verb."""
