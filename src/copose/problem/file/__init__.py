"""Problem files: reading, messages, overrides, schema."""
