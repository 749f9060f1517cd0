"""Files on disk: atomic writing, folders, hashes, locks, and where the product keeps its own."""
