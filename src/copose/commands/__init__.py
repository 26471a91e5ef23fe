"""The commands of `copose`, and the command line that runs them."""
