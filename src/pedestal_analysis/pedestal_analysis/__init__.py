"""Analysis of recordings and scenarios: results, reports, reprocessing, trials, tuning."""
