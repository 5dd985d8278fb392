"""Tracking: an attached cloth that is kept in step with a stream of images by its physics and by what is seen."""
