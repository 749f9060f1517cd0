"""The controllers, one file each; `twin.control.controller` finds them here."""
