"""Laws that both twins obey, MuJoCo's and the reduced one: wires, friction, hinges, drive, command."""
