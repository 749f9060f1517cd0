"""Files on disk: atomic writing, folders, hashes, locks, and the assets folder."""
