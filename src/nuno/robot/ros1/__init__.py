"""A robot in a ROS 1 graph: a node that the Python with rospy runs, which Nuno's own need not be."""
