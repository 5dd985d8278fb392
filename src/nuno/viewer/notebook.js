// The viewer in a notebook: a frame with the page, whose messages go by the notebook's own channel to the kernel.

function render({ model, el }) {
  const frame = document.createElement("iframe");
  frame.style.cssText = "width: 100%; height: 500px; border: none";
  let waiting = [];  // until the page is ready; null from then on
  const give = (view) => {
    const bytes = view.buffer.slice(view.byteOffset, view.byteOffset + view.byteLength);
    frame.contentWindow.postMessage(bytes, "*", [bytes]);
  };
  const take = (_, buffers) => { if (waiting === null) give(buffers[0]); else waiting.push(buffers[0]); };
  const hear = (event) => {
    if (event.source !== frame.contentWindow) return;
    const order = JSON.parse(event.data);
    if (order.do === "hello") {  // at once, also while the kernel runs a cell
      give(model.get("first"));
      (waiting || []).forEach(give);
      waiting = null;
    }
    model.send(order);
  };
  model.on("msg:custom", take);
  addEventListener("message", hear);
  frame.srcdoc = model.get("page");
  el.append(frame);
  return () => {
    model.off("msg:custom", take);
    removeEventListener("message", hear);
  };
}

export default { render };
