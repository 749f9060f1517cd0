"""The checks of the gate, one file for each family; `twin.gate.table` has them in their order."""
