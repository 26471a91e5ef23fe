"""The problem on the page as a file: its tables, its text, and saving."""
