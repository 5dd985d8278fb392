"""Fields of ROS 2's standard messages, in order, as their .msg and .action files have them (Humble to Kilted)."""

STAMPED_POINT = "trajectory_msgs/msg/JointTrajectoryPoint"
DEFINITIONS = {
    "builtin_interfaces/msg/Time": "int32 sec, uint32 nanosec",
    "builtin_interfaces/msg/Duration": "int32 sec, uint32 nanosec",
    "std_msgs/msg/Header": "builtin_interfaces/msg/Time stamp, string frame_id",
    "std_msgs/msg/String": "string data",
    "rosgraph_msgs/msg/Clock": "builtin_interfaces/msg/Time clock",
    "geometry_msgs/msg/Vector3": "float64 x, float64 y, float64 z",
    "geometry_msgs/msg/Point": "float64 x, float64 y, float64 z",
    "geometry_msgs/msg/Quaternion": "float64 x, float64 y, float64 z, float64 w",
    "geometry_msgs/msg/Pose": "geometry_msgs/msg/Point position, geometry_msgs/msg/Quaternion orientation",
    "geometry_msgs/msg/Twist": "geometry_msgs/msg/Vector3 linear, geometry_msgs/msg/Vector3 angular",
    "geometry_msgs/msg/Wrench": "geometry_msgs/msg/Vector3 force, geometry_msgs/msg/Vector3 torque",
    "geometry_msgs/msg/WrenchStamped": "std_msgs/msg/Header header, geometry_msgs/msg/Wrench wrench",
    "geometry_msgs/msg/PoseWithCovariance": "geometry_msgs/msg/Pose pose, float64[36] covariance",
    "geometry_msgs/msg/TwistWithCovariance": "geometry_msgs/msg/Twist twist, float64[36] covariance",
    "geometry_msgs/msg/Transform": "geometry_msgs/msg/Vector3 translation, geometry_msgs/msg/Quaternion rotation",
    "geometry_msgs/msg/TransformStamped": (
        "std_msgs/msg/Header header, string child_frame_id, geometry_msgs/msg/Transform transform"
    ),
    "tf2_msgs/msg/TFMessage": "geometry_msgs/msg/TransformStamped[] transforms",
    "nav_msgs/msg/Odometry": (
        "std_msgs/msg/Header header, string child_frame_id, geometry_msgs/msg/PoseWithCovariance pose, "
        "geometry_msgs/msg/TwistWithCovariance twist"
    ),
    "sensor_msgs/msg/JointState": (
        "std_msgs/msg/Header header, string[] name, float64[] position, float64[] velocity, float64[] effort"
    ),
    "sensor_msgs/msg/Imu": (
        "std_msgs/msg/Header header, geometry_msgs/msg/Quaternion orientation, float64[9] orientation_covariance, "
        "geometry_msgs/msg/Vector3 angular_velocity, float64[9] angular_velocity_covariance, "
        "geometry_msgs/msg/Vector3 linear_acceleration, float64[9] linear_acceleration_covariance"
    ),
    "sensor_msgs/msg/Image": (
        "std_msgs/msg/Header header, uint32 height, uint32 width, string encoding, uint8 is_bigendian, uint32 step, "
        "uint8[] data"
    ),
    "sensor_msgs/msg/CompressedImage": "std_msgs/msg/Header header, string format, uint8[] data",
    "sensor_msgs/msg/RegionOfInterest": (
        "uint32 x_offset, uint32 y_offset, uint32 height, uint32 width, bool do_rectify"
    ),
    "sensor_msgs/msg/CameraInfo": (
        "std_msgs/msg/Header header, uint32 height, uint32 width, string distortion_model, float64[] d, float64[9] k, "
        "float64[9] r, float64[12] p, uint32 binning_x, uint32 binning_y, sensor_msgs/msg/RegionOfInterest roi"
    ),
    STAMPED_POINT: (
        "float64[] positions, float64[] velocities, float64[] accelerations, float64[] effort, "
        "builtin_interfaces/msg/Duration time_from_start"
    ),
    "trajectory_msgs/msg/JointTrajectory": (
        f"std_msgs/msg/Header header, string[] joint_names, {STAMPED_POINT}[] points"
    ),
    "trajectory_msgs/msg/MultiDOFJointTrajectoryPoint": (
        "geometry_msgs/msg/Transform[] transforms, geometry_msgs/msg/Twist[] velocities, "
        "geometry_msgs/msg/Twist[] accelerations, builtin_interfaces/msg/Duration time_from_start"
    ),
    "trajectory_msgs/msg/MultiDOFJointTrajectory": (
        "std_msgs/msg/Header header, string[] joint_names, trajectory_msgs/msg/MultiDOFJointTrajectoryPoint[] points"
    ),
    "control_msgs/msg/JointTolerance": "string name, float64 position, float64 velocity, float64 acceleration",
    "control_msgs/msg/JointComponentTolerance": (
        "string joint_name, uint16 component, float64 position, float64 velocity, float64 acceleration"
    ),
    "control_msgs/action/FollowJointTrajectory_Goal": (
        "trajectory_msgs/msg/JointTrajectory trajectory, "
        "trajectory_msgs/msg/MultiDOFJointTrajectory multi_dof_trajectory, "
        "control_msgs/msg/JointTolerance[] path_tolerance, "
        "control_msgs/msg/JointComponentTolerance[] component_path_tolerance, "
        "control_msgs/msg/JointTolerance[] goal_tolerance, "
        "control_msgs/msg/JointComponentTolerance[] component_goal_tolerance, "
        "builtin_interfaces/msg/Duration goal_time_tolerance"
    ),
    "control_msgs/action/FollowJointTrajectory_Result": "int32 error_code, string error_string",
    "control_msgs/action/FollowJointTrajectory_Feedback": (
        f"std_msgs/msg/Header header, string[] joint_names, {STAMPED_POINT} desired, {STAMPED_POINT} actual, "
        f"{STAMPED_POINT} error, string[] multi_dof_joint_names, "
        "trajectory_msgs/msg/MultiDOFJointTrajectoryPoint multi_dof_desired, "
        "trajectory_msgs/msg/MultiDOFJointTrajectoryPoint multi_dof_actual, "
        "trajectory_msgs/msg/MultiDOFJointTrajectoryPoint multi_dof_error"
    ),
    "unique_identifier_msgs/msg/UUID": "uint8[16] uuid",
    "action_msgs/msg/GoalInfo": "unique_identifier_msgs/msg/UUID goal_id, builtin_interfaces/msg/Time stamp",
    "action_msgs/msg/GoalStatus": "action_msgs/msg/GoalInfo goal_info, int8 status",
    "action_msgs/msg/GoalStatusArray": "action_msgs/msg/GoalStatus[] status_list",
    # Requests and responses begin with the header that rmw_cyclonedds_cpp puts before them: the asker and its number
    "control_msgs/action/FollowJointTrajectory_SendGoal_Request": (
        "uint64 guid, int64 seq, unique_identifier_msgs/msg/UUID goal_id, "
        "control_msgs/action/FollowJointTrajectory_Goal goal"
    ),
    "control_msgs/action/FollowJointTrajectory_SendGoal_Response": (
        "uint64 guid, int64 seq, bool accepted, builtin_interfaces/msg/Time stamp"
    ),
    "control_msgs/action/FollowJointTrajectory_GetResult_Request": (
        "uint64 guid, int64 seq, unique_identifier_msgs/msg/UUID goal_id"
    ),
    "control_msgs/action/FollowJointTrajectory_GetResult_Response": (
        "uint64 guid, int64 seq, int8 status, control_msgs/action/FollowJointTrajectory_Result result"
    ),
    "control_msgs/action/FollowJointTrajectory_FeedbackMessage": (
        "unique_identifier_msgs/msg/UUID goal_id, control_msgs/action/FollowJointTrajectory_Feedback feedback"
    ),
    "action_msgs/srv/CancelGoal_Request": "uint64 guid, int64 seq, action_msgs/msg/GoalInfo goal_info",
    "action_msgs/srv/CancelGoal_Response": (
        "uint64 guid, int64 seq, int8 return_code, action_msgs/msg/GoalInfo[] goals_canceling"
    ),
}
"""By type: types and names of the fields, in the order in which they are sent."""
