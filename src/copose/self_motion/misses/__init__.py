"""The distance of an arm from a grasp that it misses, and proofs that it must."""
