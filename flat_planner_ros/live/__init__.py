"""The live view's web server and page; free of ROS."""
