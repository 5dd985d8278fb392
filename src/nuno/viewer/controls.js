// Controls: buttons and boxes that tell the program what to do, the body that is picked, and plots.

let say = null;     // tells the program; null where nothing listens
let picked = { name: null, ids: [] };
const CLICK = 4;    // pixels that the mouse may move in a click

function order(name, more) { if (say) say({ do: name, ...more }); }

function hide_controls() { element("panel").hidden = true; }

function fill(list, values, chosen) {
  const own = values.map(([value, text]) => `${value}\n${text}`).join("\n");
  if (list.dataset.own !== own) {
    list.replaceChildren(...values.map(([value, text]) => new Option(text, value)));
    list.dataset.own = own;
  }
  list.value = chosen;
}

function show_controls(command) {
  element("panel").hidden = !command.can;
  element("go").textContent = command.state === "running" ? "Pause" : "Play";
  element("one").disabled = command.state === "running";
  const pace = element("pace");
  if (![...pace.options].some((option) => option.value === String(command.speed))) {
    pace.add(new Option(`${command.speed} x`, command.speed));
  }
  pace.value = String(command.speed);
  for (const [what, on] of Object.entries(command.marks)) {
    let box = document.querySelector(`#marks input[name="${what}"]`);
    if (!box) {
      const label = document.createElement("label");
      box = Object.assign(document.createElement("input"), { type: "checkbox", name: what });
      box.onchange = () => order("show", { what, on: box.checked });
      label.append(box, ` ${what}`);
      element("marks").append(label);
    }
    box.checked = on;
  }
  element("batch").hidden = command.count < 2;
  if (document.activeElement !== element("worlds")) element("worlds").value = command.worlds.join(", ");
  element("worlds").title = `numbers from 0 to ${command.count - 1}; empty: as many as fit`;
}

function show_picked(command) {
  for (const id of picked.ids) { const thing = things.get(id); if (thing) thing.mark(false); }
  picked = command;
  element("picked").hidden = command.name === null;
  if (command.name === null) return;
  for (const id of command.ids) { const thing = things.get(id); if (thing) thing.mark(true); }
  element("name").textContent = command.name;
  element("attach").textContent = command.dynamic ? "Detach" : "Attach";
  element("rows").replaceChildren(...command.rows.map(([label, text]) => {
    const row = document.createElement("tr");
    row.append(...[label, text].map((part) => Object.assign(document.createElement("td"), { textContent: part })));
    return row;
  }));
  fill(element("color"), [["", "its own"], ...command.quantities.map((name) => [name, name])], command.color_by || "");
  fill(element("value"), [["", "a value ..."], ...command.values.map((name) => [name, name])], "");
}

function show_plots(command) {
  const box = element("plots");
  while (box.children.length > command.plots.length) box.lastChild.remove();
  command.plots.forEach((plot, k) => {
    let own = box.children[k];
    if (!own) {
      own = document.createElement("section");
      own.innerHTML = "<div><span></span><button type=\"button\" title=\"remove\">×</button></div>"
        + "<canvas width=\"560\" height=\"168\"></canvas>";
      box.append(own);
    }
    const latest = plot.values.length ? plot.values[plot.values.length - 1] : NaN;
    own.querySelector("span").textContent = `${plot.name}: ${latest.toPrecision(4)} ${plot.unit}`;
    own.querySelector("button").onclick = () => order("remove plot", { name: plot.name });
    draw_plot(own.querySelector("canvas"), plot);
  });
}

function draw_plot(canvas, plot) {
  const pen = canvas.getContext("2d"), w = canvas.width, h = canvas.height;
  pen.clearRect(0, 0, w, h);
  const values = plot.values.filter(Number.isFinite);
  if (!values.length) return;
  let low = Math.min(...values), high = Math.max(...values);
  const room = Math.max(1e-9, 1e-3 * Math.abs(high));
  if (high - low < room) { low -= room; high += room; }
  const first = plot.times[0], last = Math.max(plot.times[plot.times.length - 1], first + 1e-6);
  const x = (time) => 4 + (w - 8) * (time - first) / (last - first), y = (value) => h - 22 - (h - 44) * (value - low) / (high - low);
  pen.strokeStyle = "#c4ccd4";
  pen.strokeRect(0.5, 0.5, w - 1, h - 1);
  pen.fillStyle = "#556";
  pen.font = "18px system-ui, sans-serif";
  pen.fillText(high.toPrecision(3), 6, 18);
  pen.fillText(`${low.toPrecision(3)}   t = ${first.toFixed(2)} to ${last.toFixed(2)} s`, 6, h - 4);
  pen.strokeStyle = "#1f5ae6";
  pen.lineWidth = 2.5;
  pen.beginPath();
  plot.values.forEach((value, k) => {
    if (!Number.isFinite(value)) return;
    if (k === 0 || !Number.isFinite(plot.values[k - 1])) pen.moveTo(x(plot.times[k]), y(value));
    else pen.lineTo(x(plot.times[k]), y(value));
  });
  pen.stroke();
}

function thing_at(x, y) {  // the number of the nearest one that is seen there, or null
  const frame = viewer.renderer.domElement.getBoundingClientRect(), ray = new THREE.Raycaster();
  const at = new THREE.Vector2(2 * (x - frame.left) / frame.width - 1, 1 - 2 * (y - frame.top) / frame.height);
  viewer.scene.updateMatrixWorld();
  ray.setFromCamera(at, viewer.camera);
  let nearest = null, away = Infinity;
  for (const [id, thing] of things) {
    if (!thing.skin || !thing.object.visible) continue;
    thing.surface.computeBoundingSphere();  // it may have deformed since the last time
    for (const hit of ray.intersectObject(thing.skin)) if (hit.distance < away) { nearest = id; away = hit.distance; }
  }
  return nearest;
}

function make_controls() {
  let from = null;
  const stage = element("stage");  // which the mouse's turns are captured by
  stage.addEventListener("pointerdown", (event) => { from = event.button === 0 ? [event.clientX, event.clientY] : null; });
  stage.addEventListener("pointerup", (event) => {
    const far = from === null ? Infinity : Math.hypot(event.clientX - from[0], event.clientY - from[1]);
    if (far <= CLICK && !film) order("pick", { id: thing_at(event.clientX, event.clientY) });
  });
  element("go").onclick = () => order(element("go").textContent === "Pause" ? "pause" : "resume");
  element("one").onclick = () => order("step");
  element("reset").onclick = () => order("reset");
  element("attach").onclick = () => order(picked.dynamic ? "detach" : "attach");
  element("pace").onchange = (event) => {
    const value = event.target.value;
    order("speed", { factor: isNaN(value) ? value : Number(value) });
  };
  element("color").onchange = (event) => order("color", { by: event.target.value || null });
  element("value").onchange = (event) => { if (event.target.value) order("plot", { value: event.target.value }); };
  element("worlds").onchange = (event) => {
    const numbers = event.target.value.split(/[ ,]+/).filter((part) => part).map(Number);
    order("worlds", { worlds: numbers.length ? numbers : null });
    event.target.blur();
  };
}
