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
    if ("items" in parts) showSelected(at("items"));
    if (ended) stop();
    if (n >= awaited) {
      awaited = 0;
      document.body.dataset.answered = n;
      flush();
    }
  }

  // In its own box only: the page stays where it is.
  function showSelected(box) {
    const row = box.querySelector(".selected"), head = box.querySelector("thead");
    if (!row) return;
    const top = row.offsetTop - head.offsetHeight, bottom = row.offsetTop + row.offsetHeight;
    if (top < box.scrollTop) box.scrollTop = top;
    else if (bottom > box.scrollTop + box.clientHeight) box.scrollTop = bottom - box.clientHeight;
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

  const field = (id) => document.querySelector(`#${id} input`);

  function act(command) {
    if (command === "play") return play();
    if (command === "go_to_frame") return field("go_to").select();
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

  at("go_to").addEventListener("submit", (event) => {
    event.preventDefault();
    const place = field("go_to");
    place.blur();
    if (place.value) act("frame:" + place.value);
  });

  for (const id of ["go_to", "person"]) {
    at(id).addEventListener("keydown", (event) => {
      if (event.key === "Escape" || (event.key === "Enter" && id === "person")) event.target.blur();
    });
  }

  document.addEventListener("change", (event) => {
    if (event.target === field("person")) act("person:" + event.target.value);
    if (event.target.closest("#video")) {
      event.target.blur();
      act("video:" + event.target.value);
    }
  });

  at("traces").addEventListener("wheel", (event) => {
    const page = document.documentElement; // where it is longer than the window, it scrolls
    if (page.scrollHeight > page.clientHeight + 1 && !event.shiftKey) return;
    event.preventDefault();
    if (Date.now() - wheeled < WHEEL_MS) return;
    wheeled = Date.now();
    act((event.deltaY || event.deltaX) < 0 ? "zoom_in" : "zoom_out");
  }, { passive: false });

  setInterval(() => {
    const lost = awaited && Date.now() - since > PATIENCE_MS;
    document.body.classList.toggle("lost", Boolean(lost));
  }, 1000);

  window.curate = {
    connect(box, panel) {
      if (inbox) return; // Bokeh before 3.9 may say more than once that the page is ready
      inbox = box;
      panel.properties.text.change.connect(() => show(panel.text));
      send("hello"); // asks for all parts
    },
  };
})();
