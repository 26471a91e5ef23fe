"""All postures of an arm that hold the object, by slices at which one joint is locked."""
