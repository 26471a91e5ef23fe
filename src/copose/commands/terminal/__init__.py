"""What commands share: the parser, options, terminal output, and the files of an answer."""
