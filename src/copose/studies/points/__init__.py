"""The points of a study: values, problems, hashes, lines."""
