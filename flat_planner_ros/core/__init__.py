"""Planning, dynamics and judgement of flat elastic arms; free of ROS, files and clocks."""
