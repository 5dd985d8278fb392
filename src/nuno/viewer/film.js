// Films: tracks of things, and the slider that goes through them.

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
      this.tinted = -1;
    }
    thing.object.visible = true;
    if (this.tints) {
      const latest = this.tints.frames.reduce((found, at, k) => (at <= frame ? k : found), -1);
      if (latest !== this.tinted) thing.tint(latest < 0 ? new Uint8Array(0) : this.tints.colors[latest]);
      this.tinted = latest;
    }
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

// A text that faces who looks, and hides behind nothing

function label(command, number) {
  const canvas = document.createElement("canvas"), font = "bold 48px system-ui, sans-serif";
  let pen = canvas.getContext("2d");
  pen.font = font;
  canvas.width = Math.ceil(pen.measureText(command.text).width) + 32;
  canvas.height = 72;
  pen = canvas.getContext("2d");  // which a new size has cleared
  pen.font = font;
  pen.textBaseline = "middle";
  pen.fillStyle = "#223";
  pen.fillText(command.text, 16, 38);
  const texture = new THREE.CanvasTexture(canvas);
  const sprite = new THREE.Sprite(new THREE.SpriteMaterial({ map: texture, depthTest: false, transparent: true }));
  sprite.scale.set(command.height * canvas.width / canvas.height, command.height, 1);
  sprite.position.set(...command.at);
  viewer.set_object(["labels", String(number)], sprite);
}

class Film {
  constructor(command) {
    (command.labels || []).forEach(label);
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
