"""The objective over the self-motions of the arms."""
