"""MuJoCo as an engine: flexes of cloth and soft bodies, rigid bodies, grips and joints as equality constraints."""
