// The page: what messages ask for, and where they come from.

const commands = {
  clear,
  enter,
  view: take_view,
  leave: (command) => command.ids.forEach(leave),
  place(command) {
    command.ids.forEach((id, k) => { const thing = things.get(id); if (thing) thing.place(command.poses, 7 * k); });
  },
  shift(command) { const thing = things.get(command.id); if (thing) thing.shift(command.points); },
  tint(command) { const thing = things.get(command.id); if (thing) thing.tint(command.colors); },
  clock(command) { if (!film) show_clock(command.time); },
  film(command) { clear(); hide_controls(); film = new Film(command); },
  controls: show_controls,
  picked: show_picked,
  plots: show_plots,
  notice: (command) => notice(command.text, 6000),
};

function obey(buffer) {
  for (const command of unpack(buffer).commands) commands[command.do](command);
  viewer.set_dirty();
}
// Where messages come from

let notices = 0;

function notice(text, span) {  // for so many milliseconds, or until the next
  const own = ++notices;
  element("notice").hidden = !text;
  element("notice").textContent = text;
  if (span) setTimeout(() => { if (own === notices) notice(""); }, span);
}

function connect() {
  const feed = new WebSocket(`ws://${location.host}/feed`);
  feed.binaryType = "arraybuffer";
  feed.onopen = () => { notice(""); say = (order) => feed.send(JSON.stringify(order)); };
  feed.onmessage = (message) => { obey(message.data); window.nuno.messages += 1; };
  feed.onclose = () => { say = null; notice("The viewer is closed."); setTimeout(connect, 1000); };
}

function connect_to_parent() {  // of the frame that a notebook shows this page in
  addEventListener("message", (event) => {
    if (event.source !== parent || !(event.data instanceof ArrayBuffer)) return;
    obey(event.data);
    window.nuno.messages += 1;
  });
  say = (order) => parent.postMessage(JSON.stringify(order), "*");
  say({ do: "hello" });
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
make_controls();
const data = element("film");
if (data) open_film(data.textContent);
else if (element("channel")) connect_to_parent();
else connect();
