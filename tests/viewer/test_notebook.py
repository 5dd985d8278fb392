"""In a notebook the page gets its messages from the kernel, on whatever machine that runs."""

import base64
import json

import numpy as np
import pytest
from browser import Browser, needs_chromium
from feed import unpack

import nuno
from nuno.viewer import Viewer, notebook
from nuno.viewer.page import channel_page

pytest.importorskip("anywidget")


def make_world():
    """Return a world with a ball that falls."""
    world = nuno.World(device="cpu")
    ball = world.add(nuno.sphere(0.1, name="ball", color="#2060e0", position=(0, 0, 0.5)))
    world.attach(ball)
    return world


def shown_in(viewer):
    """Return a channel of a viewer that is shown in a notebook, and the messages that it has sent."""
    bundle = viewer._repr_mimebundle_()
    assert "application/vnd.jupyter.widget-view+json" in bundle
    channel = viewer._channels[-1]
    sent = []
    channel.widget.send = lambda content, buffers: sent.extend(buffers)
    return channel, sent


def test_the_page_is_kept_up_to_date_through_the_kernel():
    """It begins with everything, gets what moved, and may say what the page of a server may say."""
    world = make_world()
    with Viewer(world, frame_rate=1e-3) as viewer:
        channel, sent = shown_in(viewer)
        assert viewer.page_count == 1
        (entered,) = (c for c in unpack(channel.widget.first) if c["do"] == "enter" and c["path"][1] == "ball")
        world.step()
        viewer.update()
        (placed,) = (c for message in sent for c in unpack(message) if c["do"] == "place")
        assert placed["ids"] == [entered["id"]]
        # float32 at 0.5 m
        np.testing.assert_allclose(placed["poses"][:3], world.find("ball").position, atol=1e-7)
        channel._take(None, {"do": "hello"}, [])
        assert any(c["do"] == "clear" for c in unpack(sent[-1])), "whoever says hello is sent everything"
        channel._take(None, {"do": "nonsense"}, [])
        for _ in range(400):
            if any(c["do"] == "notice" for message in sent for c in unpack(message)):
                break
            viewer._stop.wait(0.05)
        assert any("nonsense" in c["text"] for message in sent for c in unpack(message) if c["do"] == "notice")
    assert "closed" in unpack(sent[-1])[0]["text"]


def test_messages_are_spread_over_time(monkeypatch):
    """Jupyter drops more than 1 MB/s: the next look waits until the last message is half of that."""
    monkeypatch.setattr("nuno.viewer.following.CHANNEL_RATE", 1.0)
    world = make_world()
    with Viewer(world) as viewer:
        _, sent = shown_in(viewer)
        world.step()
        viewer.update()
        before = len(sent)
        assert before
        world.step()
        viewer._follow_once()
        assert len(sent) == before


def test_without_control_a_notebook_says_nothing():
    """As a page of a server."""
    world = make_world()
    with Viewer(world, control=False) as viewer:
        channel, _ = shown_in(viewer)
        channel._take(None, {"do": "step"}, [])
        assert viewer._worker is None and world.time == 0.0


def test_without_anywidget_a_still_scene_is_shown(monkeypatch):
    """It needs no server either."""
    monkeypatch.setattr("nuno.viewer.viewer.has_widgets", lambda: False)
    with Viewer(make_world()) as viewer:
        assert viewer._repr_mimebundle_() == {}
        shown = viewer._repr_html_()
        assert "srcdoc" in shown and "127.0.0.1" not in shown
    assert "closed" in viewer._repr_html_()
    assert viewer._repr_mimebundle_() == {}


@needs_chromium
def test_the_frame_hands_messages_on(tmp_path):
    """A page in a frame draws what the kernel sends, in order, and its orders reach the kernel."""
    world = make_world()
    with Viewer(world, frame_rate=1e-3) as viewer:
        channel, sent = shown_in(viewer)
        first = base64.b64encode(channel.widget.first).decode()
        world.run(0.2)
        viewer.update()
        moved = base64.b64encode(sent[-1]).decode()
        module = base64.b64encode((notebook.FilePath(notebook.__file__).parent / "notebook.js").read_bytes()).decode()
        text = json.dumps(channel_page()).replace("</", r"<\/")
        page = f"""<body><div id="cell"></div><script type="module">
            import widget from "data:text/javascript;base64,{module}";
            const bytes = (text) => new DataView(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer);
            window.said = [];
            window.nuno = {{ ready: () => true }};
            const values = {{ page: {text}, first: bytes("{first}") }};
            const model = {{
              get: (name) => values[name], send: (order) => said.push(order), off() {{}},
              on: (kind, take) => take({{}}, [bytes("{moved}")]),  // before the page is ready
            }};
            widget.render({{ model, el: document.getElementById("cell") }});
        </script></body>"""
        path = tmp_path / "cell.html"
        path.write_text(page)
        with Browser(700, 600) as browser:
            browser.open(path.as_uri())
            inside = "document.querySelector('iframe').contentWindow"
            browser.wait_for(f"{inside}.nuno && {inside}.nuno.messages === 2")
            find = "[...document.querySelector('iframe').contentWindow.nuno.things.values()]"
            height = browser.evaluate(f"{find}.find((t) => t.path[1] === 'ball').object.position.z")
            # float32 at 0.3 m
            assert height == pytest.approx(world.find("ball").position[2], abs=1e-7)
            assert not browser.evaluate(f"{inside}.document.getElementById('panel').hidden")
            browser.evaluate(f"{inside}.document.getElementById('go').click()")
            browser.wait_for("said.length === 2")
            assert browser.evaluate("said") == [{"do": "hello"}, {"do": "pause"}]
            assert [url for url in browser.requests if url.startswith("http")] == []
            assert browser.complaints == []
