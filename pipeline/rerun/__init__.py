"""Recording of the robot's maps, plans and measurements in Rerun, step by step."""
