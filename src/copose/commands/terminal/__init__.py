"""Shared parts of commands: the parser, options, terminal output, and the files of an answer."""
