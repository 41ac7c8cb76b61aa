"""How fast it is: against SUMO's bare steps, against the obvious alternatives, and by cases and processes."""
