// Keys, clicks and the wheel go to the program as commands; parts of the page come back as HTML.
// While an answer is awaited further commands queue up and go together: holding a key never lags.
(() => {
  "use strict";
  const PATIENCE_MS = 8000, PLAY_MS = 50, WHEEL_MS = 120;
  const queue = [];
  let inbox = null, awaited = 0, count = 0, since = 0, player = null, wheeled = 0;
  const at = (id) => document.getElementById(id);

  function send(command) {
    queue.push(command);
    flush();
  }

  function flush() {
    if (!inbox || awaited || !queue.length) return;
    awaited = ++count;
    since = Date.now();
    inbox.value = JSON.stringify({ n: awaited, commands: queue.splice(0) });
  }

  function show(text) {
    if (!text) return;
    const { n, parts, helps, ended, aspect, lanes } = JSON.parse(text);
    for (const [id, html] of Object.entries(parts)) at(id).innerHTML = html;
    at("help").hidden = !helps;
    at("cover").hidden = !at("cover").textContent.trim();
    document.documentElement.style.setProperty("--aspect", aspect);
    document.documentElement.style.setProperty("--lanes", lanes);
    if ("items" in parts) {
      at("items").querySelector(".selected")?.scrollIntoView({ block: "nearest" });
    }
    if (ended) stop();
    if (n >= awaited) {
      awaited = 0;
      document.body.dataset.answered = n;
      flush();
    }
  }

  function play() {
    if (player) return stop();
    player = setInterval(() => awaited || queue.length || send("next_frame"), PLAY_MS);
    document.body.classList.add("playing");
  }

  function stop() {
    clearInterval(player);
    player = null;
    document.body.classList.remove("playing");
  }

  function act(command) {
    if (command === "play") return play();
    stop();
    send(command);
  }

  function nameOf(event) {
    const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    const letter = event.key.length > 1 || /[a-z]/.test(key);
    return (event.ctrlKey || event.metaKey ? "Ctrl+" : "") + (event.shiftKey && letter ? "Shift+" : "") + key;
  }

  window.addEventListener("keydown", (event) => {
    const command = event.altKey ? null : window.curateKeys[nameOf(event)];
    if (!command || /^(INPUT|SELECT|TEXTAREA)$/.test(event.target.tagName)) return;
    event.preventDefault();
    if (event.repeat && !/frame|forward|back/.test(command)) return;
    act(command);
  }, true);

  // Rows may be made anew between press and release, and would then get no click.
  document.addEventListener("mousedown", (event) => {
    const row = event.target.closest("tr[data-do]");
    if (row) act(row.dataset.do);
  });

  document.addEventListener("click", (event) => {
    const button = event.target.closest("button[data-do]");
    if (button) {
      act(button.dataset.do);
      button.blur();
    } else if (event.target.closest("#help")) act("show_help");
  });

  document.addEventListener("change", (event) => {
    if (event.target.closest("#video")) {
      event.target.blur();
      act("video:" + event.target.value);
    }
  });

  at("traces").addEventListener("wheel", (event) => {
    event.preventDefault();
    if (Date.now() - wheeled < WHEEL_MS) return;
    wheeled = Date.now();
    act(event.deltaY < 0 ? "zoom_in" : "zoom_out");
  }, { passive: false });

  setInterval(() => {
    const lost = awaited && Date.now() - since > PATIENCE_MS;
    document.body.classList.toggle("lost", Boolean(lost));
  }, 1000);

  window.curate = {
    connect(box, panel) {
      inbox = box;
      panel.properties.text.change.connect(() => show(panel.text));
      send("hello"); // asks for all parts
    },
  };
})();
