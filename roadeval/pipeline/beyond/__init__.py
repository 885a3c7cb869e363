"""Stages that the paper does not have."""
