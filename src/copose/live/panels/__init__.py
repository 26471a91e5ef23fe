"""The panel beside the scene, a module for each of its parts."""
