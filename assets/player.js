// Moves pose, loop and time of a record by a slider; what it draws is in the page already.
document.querySelectorAll("figure.player").forEach((figure) => {
  const samples = JSON.parse(figure.querySelector("script").textContent);
  const controls = figure.querySelector(".controls");
  const [button, slider, output] = ["button", "input", "output"].map((name) => controls.querySelector(name));
  const part = (name) => figure.querySelectorAll(`.${name}`);
  const last = samples.time_s.length - 1;
  let started = null;

  function pose(k) {
    let [x, y, turned] = [samples.base[0], samples.base[1], 0];
    const points = [[x, y]];
    for (const hinge of samples.hinges_deg[k]) {
      turned += (hinge * Math.PI) / 180;
      x += samples.link * Math.sin(turned);
      y -= samples.link * Math.cos(turned);
      points.push([x, y]);
    }
    return points.map((point) => point.map((value) => value.toFixed(1)).join(",")).join(" ");
  }

  function show(k) {
    const points = pose(k);
    part("body").forEach((line) => line.setAttribute("points", points));
    part("dot").forEach((dot) => {
      dot.setAttribute("cx", samples.loop_x[k]);
      dot.setAttribute("cy", samples.loop_y[k]);
    });
    const trace = samples.loop_x.slice(0, k + 1).map((x, i) => `${x},${samples.loop_y[i]}`);
    part("trace").forEach((line) => line.setAttribute("points", trace.slice(-60).join(" ")));
    slider.value = k;
    const [time, pull, bend] = [samples.time_s[k], samples.pull_mm[k], samples.bend_deg[k]];
    const shown = [`${time.toFixed(1)} s`, `pull ${pull.toFixed(2)} mm`, `bend ${bend.toFixed(1)} deg`];
    output.textContent = shown.join(", ").replace(/-/g, "\u2212");
    slider.setAttribute("aria-valuetext", shown.join(", "));
  }

  function step(now) {
    if (started === null) return;
    const k = started.from + Math.floor((now - started.at) / 40);
    if (k > last) return stop();
    show(k);
    requestAnimationFrame(step);
  }

  function stop() {
    started = null;
    button.textContent = "Play";
  }

  button.addEventListener("click", () => {
    if (started !== null) return stop();
    const from = Number(slider.value) >= last ? 0 : Number(slider.value);
    started = { from, at: performance.now() };
    button.textContent = "Pause";
    requestAnimationFrame(step);
  });
  slider.addEventListener("input", () => {
    stop();
    show(Number(slider.value));
  });
  controls.hidden = false;
  show(samples.first);
});
