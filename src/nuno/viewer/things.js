// Things: what is drawn, by number; messages say how they change.

// Messages: the header's length, the header (JSON), then arrays

function unpack(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const start = 4 + length;
  const types = { f4: Float32Array, u1: Uint8Array, u2: Uint16Array, u4: Uint32Array };
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

const LINEAR = Float32Array.from({ length: 256 }, (_, k) => {
  const value = k / 255;
  return value <= 0.04045 ? value / 12.92 : Math.pow((value + 0.055) / 1.055, 2.4);
});

function linear_colors(colors) {
  return Float32Array.from(colors, (value) => LINEAR[value]);
}

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
      // skins lie behind their outlines, and a floor behind the skins of what lies on it
      const back = command.endless ? 2 : Number(command.lines.length > 0);
      const inset = { polygonOffset: back > 0, polygonOffsetFactor: back, polygonOffsetUnits: back };
      const mesh = new THREE.Mesh(this.surface, material_of(command, inset));
      this.skin = mesh;
      this.own_color = command.color;
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
      if (command.triangles.length === 0 && command.colors) {
        this.edges.setAttribute("color", new THREE.BufferAttribute(linear_colors(command.colors), 3));
        material.vertexColors = true;
      } else material.color.setRGB(shade * r, shade * g, shade * b);
      material.opacity = command.opacity;
      material.transparent = command.opacity < 1;
      const lines = new THREE.LineSegments(this.edges, material);
      lines.frustumCulled = false;
      if (command.triangles.length) {
        this.outline = lines;
        this.outline_color = material.color.toArray();
      }
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
    if (command.colors && this.surface) this.tint(command.colors);
  }

  tint(colors) {  // of each point, or none: its own colour
    if (!this.surface) return;
    const material = this.skin.material, tinted = colors.length > 0;
    if (tinted) {
      const own = linear_colors(colors), source = this.source;
      const room = source === null ? own : new Float32Array(3 * source.length);
      if (source !== null) source.forEach((from, to) => room.set(own.subarray(3 * from, 3 * from + 3), 3 * to));
      this.surface.setAttribute("color", new THREE.BufferAttribute(room, 3));
      material.color.setRGB(1, 1, 1);
    } else material.color.setRGB(...this.own_color);
    if (material.vertexColors !== tinted) {
      material.vertexColors = tinted;
      material.needsUpdate = true;
    }
  }

  mark(on) {  // as the one that is picked
    if (this.outline) {
      this.outline.material.color.setRGB(...(on ? [1, 0.3, 0] : this.outline_color));
    } else if (this.skin) this.skin.material.emissive.setRGB(on ? 0.12 : 0, on ? 0.07 : 0, 0);
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

  tint() {}

  mark() {}
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
