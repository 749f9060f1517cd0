"""Drawing of the endoscope by MuJoCo's renderer: its smooth parts, where they stand, and pictures of them."""
