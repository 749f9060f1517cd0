"""Sample logs, a stream and a tiny dataset, with which every printed command can be tried."""
