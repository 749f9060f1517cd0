"""Pictures of an episode without a screen: the endoscope bending beside its loop, as PNG, MP4 and JPEG."""
