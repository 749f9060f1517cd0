"""Headless rendering of episodes: the bending endoscope beside its loop, as PNG, MP4 and JPEG."""
