"""Methods of the robot by their names, sarsim's and the user's own, made, tried and watched."""
