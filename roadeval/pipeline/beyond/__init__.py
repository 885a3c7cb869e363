"""Stages that the paper does not have, one file each, its name the stage's name."""
