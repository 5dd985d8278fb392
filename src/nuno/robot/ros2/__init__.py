"""A robot in a ROS 2 graph: its standard messages over DDS, without an installation of ROS."""
