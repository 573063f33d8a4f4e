"""What recordings and trials show: results, reports, reprocessing, many runs, tuning."""
