"""Image files: from their bytes to arrays. A damaged file is an error, never half a picture.

No other room decodes them, so that camera, truth, masks and the pictures of a recording are read,
checked and refused alike.
"""
