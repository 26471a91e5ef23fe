"""The global search: samples, screening, ranking, multistart."""
