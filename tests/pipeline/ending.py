"""A script that ends the program when it is imported."""

import sys


def road(image):
    """Road is everywhere."""
    return image[..., 0] >= 0


sys.exit(0)
