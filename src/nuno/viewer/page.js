"use strict";
// The page of a viewer: it keeps meshcat's scene as the messages say, and plays films.
(function () {
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

  // Messages: the header's length, the header (JSON), then arrays

  function unpack(buffer) {
    const length = new DataView(buffer).getUint32(0, true);
    const start = 4 + length;
    const types = { f4: Float32Array, u2: Uint16Array, u4: Uint32Array };
    return JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)), (key, value) => {
      if (value && value.array && value.array.type) {
        const { type, at, count } = value.array;
        return new types[type](buffer.slice(start + at, start + at + count * types[type].BYTES_PER_ELEMENT));
      }
      return value;
    });
  }

  // Meshes with sharp edges: a vertex is split between faces that meet there at more than so many degrees

  function split(points, triangles, crease) {
    const count = triangles.length;
    if (crease === null) return { source: null, index: triangles };
    const source = [], index = new Uint32Array(count);
    if (crease === 0) {
      for (let k = 0; k < count; k++) index[k] = k;
      return { source: Uint32Array.from(triangles), index };
    }
    const normals = new Float32Array(count), a = new THREE.Vector3(), b = new THREE.Vector3(), c = new THREE.Vector3();
    for (let t = 0; t < count; t += 3) {
      a.fromArray(points, 3 * triangles[t]);
      b.fromArray(points, 3 * triangles[t + 1]).sub(a);
      c.fromArray(points, 3 * triangles[t + 2]).sub(a);
      b.cross(c).normalize().toArray(normals, t);
    }
    const cosine = Math.cos(crease * Math.PI / 180);
    const kept = new Array(points.length / 3);  // of each vertex: what it was split into, with the normals there
    for (let k = 0; k < count; k++) {
      const vertex = triangles[k], t = k - k % 3;
      const x = normals[t], y = normals[t + 1], z = normals[t + 2];
      const known = kept[vertex] || (kept[vertex] = []);
      let own = known.find((other) => other.x * x + other.y * y + other.z * z >= cosine);
      if (!own) {
        own = { x, y, z, number: source.length };
        source.push(vertex);
        known.push(own);
      }
      index[k] = own.number;
    }
    return { source: Uint32Array.from(source), index };
  }

  // Things

  function material_of(command, options) {
    const [r, g, b] = command.color;
    const solid = { roughness: 0.72, metalness: 0.0, side: THREE.DoubleSide, ...options };
    const material = new THREE.MeshStandardMaterial(solid);
    material.color.setRGB(r, g, b);
    material.opacity = command.opacity;
    material.transparent = command.opacity < 1;
    return material;
  }

  class Mesh {
    constructor(command, points) {
      this.object = new THREE.Group();
      if (command.triangles.length) {
        const { source, index } = split(points, command.triangles, command.crease);
        this.source = source;
        this.surface = new THREE.BufferGeometry();
        this.surface.setIndex(new THREE.BufferAttribute(Uint32Array.from(index), 1));
        const room = new Float32Array(source === null ? points.length : 3 * source.length);
        this.surface.setAttribute("position", new THREE.BufferAttribute(room, 3));
        const inset = { polygonOffset: command.lines.length > 0, polygonOffsetFactor: 1, polygonOffsetUnits: 1 };
        const mesh = new THREE.Mesh(this.surface, material_of(command, inset));
        mesh.castShadow = !command.endless;
        mesh.receiveShadow = true;
        mesh.frustumCulled = false;
        this.object.add(mesh);
      }
      if (command.lines.length) {
        this.edges = new THREE.BufferGeometry();
        this.edges.setIndex(new THREE.BufferAttribute(Uint32Array.from(command.lines), 1));
        this.edges.setAttribute("position", new THREE.BufferAttribute(new Float32Array(points.length), 3));
        const shade = command.triangles.length ? 0.25 : 0.5, [r, g, b] = command.color;
        const material = new THREE.LineBasicMaterial();
        material.color.setRGB(shade * r, shade * g, shade * b);
        material.opacity = command.opacity;
        material.transparent = command.opacity < 1;
        const lines = new THREE.LineSegments(this.edges, material);
        lines.frustumCulled = false;
        this.object.add(lines);
      }
      if (command.endless) {
        const grid = new THREE.GridHelper(10, 20, 0x7d8894, 0xaab3bc);
        grid.rotateX(Math.PI / 2);
        grid.position.z = 0.0008;
        grid.material.transparent = true;
        grid.material.opacity = 0.45;
        this.object.add(grid);
      }
      this.shift(points);
    }

    shift(points) {
      if (this.surface) {
        const room = this.surface.attributes.position, own = room.array, source = this.source;
        if (source === null) own.set(points);
        else for (let k = 0; k < source.length; k++) {
          const from = 3 * source[k], to = 3 * k;
          own[to] = points[from]; own[to + 1] = points[from + 1]; own[to + 2] = points[from + 2];
        }
        room.needsUpdate = true;
        this.surface.computeVertexNormals();
      }
      if (this.edges) {
        this.edges.attributes.position.array.set(points);
        this.edges.attributes.position.needsUpdate = true;
      }
    }

    place(pose, at) {
      this.object.position.set(pose[at], pose[at + 1], pose[at + 2]);
      this.object.quaternion.set(pose[at + 4], pose[at + 5], pose[at + 6], pose[at + 3]);
    }
  }

  class Marks {  // balls at points, or arrows between pairs of them: as many as there are now
    constructor(command, points) {
      this.command = command;
      this.object = new THREE.Group();
      this.room = 0;
      this.shift(points);
    }

    make(room) {
      for (const child of [...this.object.children]) { this.object.remove(child); child.geometry.dispose(); }
      const size = this.command.size, material = material_of(this.command, {});
      const add = (geometry) => {
        const made = new THREE.InstancedMesh(geometry, material, room);
        made.frustumCulled = false;
        this.object.add(made);
        return made;
      };
      this.balls = this.shafts = this.heads = this.feet = null;
      if (this.command.kind === "balls") this.balls = add(new THREE.SphereGeometry(size, 16, 12));
      else {
        this.shafts = add(new THREE.CylinderGeometry(0.5 * size, 0.5 * size, 1, 10).translate(0, 0.5, 0));
        this.feet = add(new THREE.SphereGeometry(0.8 * size, 10, 8));
        this.heads = add(new THREE.ConeGeometry(1.3 * size, 3 * size, 12).translate(0, 1.5 * size, 0));
      }
      this.room = room;
    }

    shift(points) {
      const count = points.length / (this.command.kind === "balls" ? 3 : 6);
      if (count > this.room) this.make(Math.max(16, 2 * count));
      this.object.visible = count > 0;
      if (!count) return;
      const matrix = new THREE.Matrix4(), up = new THREE.Vector3(0, 1, 0), turn = new THREE.Quaternion();
      const from = new THREE.Vector3(), way = new THREE.Vector3(), scale = new THREE.Vector3(1, 1, 1);
      for (let k = 0; k < count; k++) {
        if (this.balls) {
          this.balls.setMatrixAt(k, matrix.makeTranslation(points[3 * k], points[3 * k + 1], points[3 * k + 2]));
          continue;
        }
        from.fromArray(points, 6 * k);
        this.feet.setMatrixAt(k, matrix.makeTranslation(from.x, from.y, from.z));
        way.fromArray(points, 6 * k + 3).sub(from);
        const length = way.length(), bulk = Math.min(1, length / (6 * this.command.size));
        turn.setFromUnitVectors(up, length > 0 ? way.clone().divideScalar(length) : up);
        this.shafts.setMatrixAt(k, matrix.compose(from, turn, scale.set(bulk, Math.max(length, 1e-6), bulk)));
        const tip = from.add(way.multiplyScalar(Math.max(0, 1 - 3 * this.command.size * bulk / Math.max(length, 1e-6))));
        this.heads.setMatrixAt(k, matrix.compose(tip, turn, scale.set(bulk, bulk, bulk)));
      }
      for (const made of this.object.children) { made.count = count; made.instanceMatrix.needsUpdate = true; }
    }

    place() {}
  }

  function enter(command) {
    leave(command.id);
    const marks = command.kind === "balls" || command.kind === "arrows";
    const thing = marks ? new Marks(command, command.points) : new Mesh(command, command.points);
    thing.path = command.path;
    if (command.pose) thing.place(command.pose, 0);
    viewer.set_object(thing.path, thing.object);
    things.set(command.id, thing);
    return thing;
  }

  function leave(id) {
    const thing = things.get(id);
    if (!thing) return;
    thing.object.traverse((part) => {
      if (part.geometry) part.geometry.dispose();
      if (part.material) part.material.dispose();
    });
    things.delete(id);
    if (![...things.values()].some((other) => other.path.join("\n") === thing.path.join("\n"))) {
      viewer.delete_path(thing.path);
    }
  }

  function clear() {
    for (const id of [...things.keys()]) leave(id);
    film = null;
    element("bar").hidden = true;
  }

  function show_clock(time) {
    element("clock").hidden = false;
    element("clock").textContent = `t = ${time.toFixed(2)} s`;
  }

  const commands = {
    clear,
    enter,
    view: take_view,
    leave: (command) => command.ids.forEach(leave),
    place(command) {
      command.ids.forEach((id, k) => { const thing = things.get(id); if (thing) thing.place(command.poses, 7 * k); });
    },
    shift(command) { const thing = things.get(command.id); if (thing) thing.shift(command.points); },
    clock(command) { if (!film) show_clock(command.time); },
    film(command) { clear(); film = new Film(command); },
  };

  function obey(buffer) {
    for (const command of unpack(buffer).commands) commands[command.do](command);
    viewer.set_dirty();
  }

  // Films

  class Track {
    constructor(row, number, frames) {
      Object.assign(this, row);
      this.id = number;
      this.end = row.last === null ? frames : row.last;
      this.marks = row.kind === "balls" || row.kind === "arrows";
      this.starts = [0];
      for (const count of row.counts || []) this.starts.push(this.starts[this.starts.length - 1] + 3 * count);
      if (!this.marks) {
        const keys = row.poses ? 1 : row.frames.length;
        this.size = row.changes.length / keys;
        for (let k = this.size; k < row.changes.length; k++) row.changes[k] += row.changes[k - this.size];
      }
    }

    points(key, next, part) {
      if (this.marks) return this.values.subarray(this.starts[key], this.starts[key + 1]);
      const own = new Float32Array(this.size), a = key * this.size, b = next * this.size;
      for (let k = 0; k < this.size; k++) {
        const steps = this.changes[a + k] * (1 - part) + this.changes[b + k] * part;
        own[k] = this.low[k % 3] + this.step[k % 3] * steps;
      }
      return own;
    }

    show(frame) {  // between two frames, things are between where they were at them
      const here = frame >= this.first && frame < this.end;
      let thing = things.get(this.id);
      if (!here) { if (thing) thing.object.visible = false; return; }
      let low = 0, high = this.frames.length - 1;
      while (low < high) { const middle = (low + high + 1) >> 1; if (this.frames[middle] <= frame) low = middle; else high = middle - 1; }
      const next = Math.min(low + 1, this.frames.length - 1);
      const part = next === low ? 0 : Math.min(1, Math.max(0, frame - (this.frames[next] - 1)));
      if (!thing) {
        const first = this.poses ? this.points(0, 0, 0) : this.points(low, next, part);
        thing = enter({ ...this, id: this.id, points: first, pose: null });
        this.shown = this.poses ? null : [low, part];
      }
      thing.object.visible = true;
      if (this.shown && this.shown[0] === low && this.shown[1] === part) return;
      this.shown = [low, part];
      if (this.poses) {
        const a = this.poses.subarray(7 * low, 7 * low + 7), b = this.poses.subarray(7 * next, 7 * next + 7);
        const from = new THREE.Quaternion(a[4], a[5], a[6], a[3]), to = new THREE.Quaternion(b[4], b[5], b[6], b[3]);
        from.slerp(to, part);
        const mix = (k) => a[k] * (1 - part) + b[k] * part;
        thing.place([mix(0), mix(1), mix(2), from.w, from.x, from.y, from.z], 0);
      } else thing.shift(this.points(low, next, part));
      if (this.marks) thing.object.visible = this.starts[low + 1] > this.starts[low];
    }
  }

  class Film {
    constructor(command) {
      this.start = command.start;
      this.times = command.times;
      this.duration = this.times[this.times.length - 1];
      this.tracks = command.tracks.map((row, k) => new Track(row, 1 + k, this.times.length));
      this.playing = false;
      const slider = element("time");
      slider.max = Math.max(this.duration, 1e-6);
      element("bar").hidden = this.times.length < 2;
      slider.oninput = () => { this.pause(); this.seek(Number(slider.value)); };
      element("play").onclick = () => (this.playing ? this.pause() : this.play());
      this.seek(0);
    }

    seek(time) {
      this.time = Math.min(Math.max(time, 0), this.duration);
      let low = 0, high = this.times.length - 1;
      while (low < high) { const middle = (low + high + 1) >> 1; if (this.times[middle] <= this.time) low = middle; else high = middle - 1; }
      let frame = low;
      if (low + 1 < this.times.length) frame += (this.time - this.times[low]) / (this.times[low + 1] - this.times[low]);
      for (const track of this.tracks) track.show(frame);
      element("time").value = this.time;
      show_clock(this.start + this.time);
      viewer.set_dirty();
    }

    play() {
      if (this.time >= this.duration) this.seek(0);
      this.playing = true;
      element("play").textContent = "Pause";
      let before = performance.now();
      const tick = (now) => {
        if (!this.playing || film !== this) return;
        this.seek(this.time + Math.max(0, now - before) / 1000 * Number(element("speed").value));
        before = now;
        if (this.time >= this.duration) this.pause();
        else requestAnimationFrame(tick);
      };
      requestAnimationFrame(tick);
    }

    pause() {
      this.playing = false;
      element("play").textContent = "Play";
    }
  }

  // Where messages come from

  function notice(text) {
    element("notice").hidden = !text;
    element("notice").textContent = text;
  }

  function connect() {
    const feed = new WebSocket(`ws://${location.host}/feed`);
    feed.binaryType = "arraybuffer";
    feed.onopen = () => notice("");
    feed.onmessage = (message) => { obey(message.data); window.nuno.messages += 1; };
    feed.onclose = () => { notice("The viewer is closed."); setTimeout(connect, 1000); };
  }

  async function open_film(text) {
    const packed = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
    const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
    obey(await new Response(stream).arrayBuffer());
    const follow = () => {
      const wanted = /[#&]t=([0-9.]+)/.exec(location.hash);
      if (wanted) film.seek(Number(wanted[1]) - film.start);
    };
    follow();
    addEventListener("hashchange", follow);
    window.nuno.messages += 1;
  }

  // for scripts: what the page shows, and the film's time from its start
  window.nuno = {
    viewer, things, messages: 0,
    seek: (time) => film.seek(time),
    ready: () => window.nuno.messages > 0 && !viewer.needs_render,
  };
  light_the_scene();
  const data = element("film");
  if (data) open_film(data.textContent);
  else connect();
})();
