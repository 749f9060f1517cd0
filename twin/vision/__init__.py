"""Virtual binocular vision: two cameras before the twin, and the bending angle from their pictures."""
