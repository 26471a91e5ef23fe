"""Proofs that no posture on the arms' self-motions beats the best by more than ε."""
