"""Maps and tables of studies."""
