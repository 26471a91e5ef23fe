"""Local optima: searches from many starts, with what a program left out."""
