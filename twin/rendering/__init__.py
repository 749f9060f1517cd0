"""Headless rendering of episodes: the bending endoscope next to its loop, as PNG, MP4 and JPEG."""
