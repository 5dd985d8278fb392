// The stage: meshcat's viewer with light, shadows and a point of view. All scripts share one function.

const THREE = MeshCat.THREE;
const element = (id) => document.getElementById(id);
const viewer = new MeshCat.Viewer(element("stage"));
const things = new Map();  // by number
let film = null;           // that is played

// Light, shadows, ground

function light_the_scene() {
  const tree = viewer.scene_tree;
  for (const name of ["Lights", "Grid", "Axes"]) tree.delete([name]);
  viewer.renderer.outputEncoding = THREE.sRGBEncoding;
  viewer.set_property(["Background"], "visible", false);
  const sky = new THREE.HemisphereLight(0xf4f8ff, 0xb9ab98, 0.45);
  sky.position.set(0, 0, 1);
  viewer.set_object(["Lights", "Sky"], sky);
  const sun = new THREE.DirectionalLight(0xfff6e8, 0.5);
  sun.castShadow = true;
  sun.shadow.mapSize.set(2048, 2048);
  sun.shadow.radius = 3;
  sun.shadow.normalBias = 0.004;
  viewer.set_object(["Lights", "Sun"], sun);
  viewer.scene.add(sun.target);
  viewer.sun = sun;
  // from behind the observer: what the sun does not reach keeps its form
  viewer.lamp = new THREE.DirectionalLight(0xffffff, 0.14);
  viewer.set_object(["Lights", "Lamp"], viewer.lamp);
}

function take_view(command) {
  const camera = viewer.camera, [ex, ey, ez] = command.eye, [tx, ty, tz] = command.target;
  camera.fov = command.field;  // three's own axes have y up
  camera.position.set(ex, ez, -ey);
  viewer.controls.target.set(tx, tz, -ty);
  const reach = 1.3 * command.reach + 0.2;
  camera.near = Math.max(0.005, 0.01 * command.reach);
  camera.far = Math.max(60, 30 * command.reach);
  camera.updateProjectionMatrix();
  viewer.controls.update();
  const sun = viewer.sun, box = sun.shadow.camera;
  sun.target.position.set(tx, ty, tz);
  sun.position.set(tx + 0.9 * reach, ty - 0.5 * reach, tz + 2.2 * reach);
  Object.assign(box, { left: -reach, right: reach, top: reach, bottom: -reach, near: 0.05 * reach, far: 5 * reach });
  box.updateProjectionMatrix();
  sun.target.updateMatrixWorld();
  viewer.lamp.position.set(ex, ey, ez);
}
