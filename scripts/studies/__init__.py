"""Our own studies, which are no part of the wheel."""
