"""The controllers, one file each; `twin.control.registry` finds them here."""
