"""Figures and HTML reports of recordings and trials."""
