"""Decoding of image files to arrays. A damaged file is an error, never half a picture.

No other room decodes image files, so that images of the camera, truth, masks and pictures of a
recording are read and checked in the same way. ``disturbing`` makes fog, rain and darkness.
"""
